"""Background traffic."""

from typing import TYPE_CHECKING

from eidrive_scenario.car_following import IntelligentDriver
from eidrive_scenario.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.traffic.background import BackgroundTraffic
    from eidrive_scenario.traffic.fleet import Fleet
    from eidrive_scenario.traffic.lane_changes import LaneChanger
    from eidrive_scenario.traffic.spawning.areas import Cursor, Stretch, polygon, road_range, stretches_cover
    from eidrive_scenario.traffic.spawning.bodies import Participant, TrafficMix
    from eidrive_scenario.traffic.spawning.generators import Area, Sink, Source, Swarm, TrafficGenerator
    from eidrive_scenario.traffic.spawning.population import Changes, Population
    from eidrive_scenario.traffic.spawning.sites import SpawnSites, sites_within_radius
else:
    __getattr__ = lazy_exports(
        __name__,
        {
            "background": "BackgroundTraffic",
            "fleet": "Fleet",
            "lane_changes": "LaneChanger",
            "spawning.areas": "Cursor Stretch polygon road_range stretches_cover",
            "spawning.bodies": "Participant TrafficMix",
            "spawning.generators": "Area Sink Source Swarm TrafficGenerator",
            "spawning.population": "Changes Population",
            "spawning.sites": "SpawnSites sites_within_radius",
        },
    )

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
