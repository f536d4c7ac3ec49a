"""Background traffic."""

from eidrive_scenario.traffic.areas import Cursor, Stretch, polygon, road_range, stretches_cover
from eidrive_scenario.traffic.background import BackgroundTraffic, Changes
from eidrive_scenario.traffic.bodies import Mixture, Participant
from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.idm import IntelligentDriver
from eidrive_scenario.traffic.instances import Area, Instance, Sink, Source, Swarm
from eidrive_scenario.traffic.mobil import LaneChanger
from eidrive_scenario.traffic.sites import Sites, around

__all__ = [
    "Area",
    "BackgroundTraffic",
    "Changes",
    "Cursor",
    "Fleet",
    "Instance",
    "IntelligentDriver",
    "LaneChanger",
    "Mixture",
    "Participant",
    "Sink",
    "Sites",
    "Source",
    "Stretch",
    "Swarm",
    "around",
    "polygon",
    "road_range",
    "stretches_cover",
]
