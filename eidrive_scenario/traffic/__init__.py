"""Background traffic."""

from typing import TYPE_CHECKING

from eidrive_scenario.base.car_following import IntelligentDriver
from eidrive_scenario.base.imports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.traffic.fleet import Fleet
    from eidrive_scenario.traffic.lane_changes import LaneChanger
    from eidrive_scenario.traffic.spawning.bodies import Participant, TrafficMix
    from eidrive_scenario.traffic.spawning.generators import (
        Area,
        BackgroundTraffic,
        Sink,
        Source,
        Swarm,
        TrafficGenerator,
    )
    from eidrive_scenario.traffic.spawning.population import Changes, Population
    from eidrive_scenario.traffic.spawning.sites import (
        Cursor,
        SpawnSites,
        Stretch,
        polygon,
        road_range,
        sites_within_radius,
        stretches_cover,
    )
    from eidrive_scenario.traffic.sumo.files import SumoFiles, sumo_files
else:
    __getattr__ = lazy_exports(
        __name__,
        {
            "fleet": "Fleet",
            "lane_changes": "LaneChanger",
            "spawning.bodies": "Participant TrafficMix",
            "spawning.generators": "Area BackgroundTraffic Sink Source Swarm TrafficGenerator",
            "spawning.population": "Changes Population",
            "spawning.sites": "Cursor SpawnSites Stretch polygon road_range sites_within_radius stretches_cover",
            "sumo.files": "SumoFiles sumo_files",
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
    "SumoFiles",
    "Swarm",
    "TrafficGenerator",
    "TrafficMix",
    "polygon",
    "road_range",
    "sites_within_radius",
    "stretches_cover",
    "sumo_files",
]
