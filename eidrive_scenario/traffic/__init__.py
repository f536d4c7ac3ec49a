"""Background traffic."""

from eidrive_scenario.traffic.background import BackgroundTraffic, Changes
from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.idm import IntelligentDriver
from eidrive_scenario.traffic.mobil import LaneChanger

__all__ = ["BackgroundTraffic", "Changes", "Fleet", "IntelligentDriver", "LaneChanger"]
