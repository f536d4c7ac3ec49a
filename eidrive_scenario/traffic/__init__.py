"""Background traffic."""

from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.idm import IntelligentDriver

__all__ = ["Fleet", "IntelligentDriver"]
