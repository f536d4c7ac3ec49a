"""Background traffic."""

from eidrive_scenario.car_following import IntelligentDriver
from eidrive_scenario.traffic.background import BackgroundTraffic
from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.mobil import LaneChanger
from eidrive_scenario.traffic.spawning.areas import Cursor, Stretch, polygon, road_range, stretches_cover
from eidrive_scenario.traffic.spawning.bodies import Participant, TrafficMix
from eidrive_scenario.traffic.spawning.generators import Area, Source, Swarm, TrafficGenerator
from eidrive_scenario.traffic.spawning.population import Changes, Population
from eidrive_scenario.traffic.spawning.sinks import Sink
from eidrive_scenario.traffic.spawning.sites import SpawnSites, sites_within_radius

__all__ = [
    "Area",
    "BackgroundTraffic",
    "Changes",
    "Cursor",
    "Fleet",
    "IntelligentDriver",
    "LaneChanger",
    "Participant",
    "Population",
    "Sink",
    "Source",
    "SpawnSites",
    "Stretch",
    "Swarm",
    "TrafficGenerator",
    "TrafficMix",
    "polygon",
    "road_range",
    "sites_within_radius",
    "stretches_cover",
]
