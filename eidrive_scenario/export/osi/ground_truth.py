"""GroundTruth messages from frames."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from eidrive_scenario.export.osi.environment import set_environment
from eidrive_scenario.export.osi.lanes import LaneMap, TrafficLights
from eidrive_scenario.export.osi.moving_objects import ACTOR, VEHICLES, add_moving_objects
from eidrive_scenario.export.osi.schemas import Identifiers, Osi
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.run_files import ROAD_FILE
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation.recorded_outcome import AxleCenters
from eidrive_scenario.world.weather import Weather

_EGOS = frozenset({"ego", "hero", "ego_vehicle"})


class GroundTruthBuilder:
    """Builder of the messages of one run. The first message contains the lanes and boundaries of the map.

    host   name of the host vehicle, or None
    towed  vehicle categories of trailers and semitrailers, by name
    axles  axles of vehicles, by name
    weather  that an option of the run sets instead of the scenario
    """

    def __init__(
        self,
        osi: Osi,
        roads: RoadNetwork | None,
        ids: Identifiers,
        host: str | None,
        towed: Mapping[str, str] = MappingProxyType({}),
        axles: Mapping[str, AxleCenters] = MappingProxyType({}),
        weather: Weather | None = None,
    ) -> None:
        self._osi = osi
        self._roads = roads
        self._ids = ids
        self._lanes = LaneMap(osi, roads, ids)
        self._lights = TrafficLights(osi, roads, ids)
        self._host = host
        self._towed = towed
        self._axles = axles
        self._weather = weather
        self._has_map = False

    def build(self, frame: Frame) -> Any:
        """Return the message of the next frame."""
        message = self._osi.begin(self._osi.ground_truth(), frame.view.time)
        if self._host is not None:
            message.host_vehicle_id.value = self._ids.of(ACTOR, self._host)
        if self._roads is not None:
            message.map_reference = ROAD_FILE
            self._set_projection(message)
        if not self._has_map:
            self._lanes.add(message)
            self._has_map = True
        lanes = self._lanes.assigned(frame.view)
        add_moving_objects(self._osi, message, frame, self._ids, lanes, self._towed, self._axles)
        self._lights.add(message, frame.signals)
        if frame.environment is not None or self._weather is not None:
            conditions = message.environmental_conditions
            set_environment(self._osi, conditions, frame.environment, frame.view.time, self._weather)
        return message

    def _set_projection(self, message: Any) -> None:
        assert self._roads is not None
        header = self._roads.header
        message.proj_string = header.geo_reference
        x, y, z, turn = header.offset
        if any(header.offset):
            offset = message.proj_frame_offset
            offset.position.x, offset.position.y, offset.position.z, offset.yaw = x, y, z, turn


def host_vehicle(run: RecordedRun) -> str | None:
    """Return the host vehicle of a run, which may enter the world later.

    It is the first station that drives, else an actor named as an ego, else the first vehicle. The frames are read
    until a station drives. A trailer is no host.
    """
    ego = vehicle = None
    towed = run.towed
    for frame in run.frames():
        view = frame.view
        driven = next((name for name, step in frame.steps.items() if step.control is not None and name in view), None)
        if driven is not None:
            return driven
        ego = ego or next((name for name in view.names if name.lower() in _EGOS), None)
        bodies = zip(view.names, view.categories, strict=True)
        vehicles = (name for name, category in bodies if category in VEHICLES and name not in towed)
        vehicle = vehicle or next(vehicles, None)
    return ego or vehicle
