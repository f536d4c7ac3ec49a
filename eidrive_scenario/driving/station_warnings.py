"""Warnings about stations: areas off the roads, lights out of view, short delays and views, fast messages, stations at
rest."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from eidrive_scenario.base.geometry import point_in_polygon
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.agent_factory import build_detector, selected_extension
from eidrive_scenario.driving.planner_settings import REACTION, Polygon
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.station_declarations import possible_drivers, property_line, station_controller
from eidrive_scenario.errors import Diagnostic, ErrorSubject
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.result_checks import checked_range
from eidrive_scenario.perception.traffic_lights import StopLine, stop_lines
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.v2x.link_models.delay import ConstantDelay
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.specs import actor_spec
from eidrive_scenario.world.view import WorldView

MARGIN = 2.0
"""Maximum distance from the outermost lane that counts as on the road [m], for bays and verges."""
_CELLS = 12
"""Number of sample cells along each side of an area."""


def areas_off_road(
    scenario: Scenario, settings: Mapping[str, AgentSettings], roads: RoadNetwork | None
) -> Iterator[Diagnostic]:
    """Yield a warning for each area of a planner of which no part is on a road."""
    if roads is None:
        return
    for name, station in settings.items():
        planner = station.planner_settings
        setting = planner.area_setting or ""
        for number, area in enumerate(planner.areas, 1):
            gap = distance_to_road(area, roads)
            if gap > MARGIN:
                what = setting.replace("_", " ")
                which = f"the {what}" if len(planner.areas) == 1 else f"{what} {number}"
                controller = station_controller(scenario, name)
                yield Diagnostic(
                    f"{which} of {name!r} never holds a vehicle on a road: it lies {gap:.0f} m off the nearest one",
                    "give world coordinates [m] in the frame of the road network: [x0, x1, y0, y1]",
                    controller.source,
                    property_line(controller, setting, "planner_settings"),
                )


def distance_to_road(area: Polygon, roads: RoadNetwork) -> float:
    """Return a lower bound of the distance between an area and the outermost lanes [m]; 0 if they may overlap."""
    low = [min(point[axis] for point in area) for axis in (0, 1)]
    step = [(max(point[axis] for point in area) - low[axis]) / _CELLS for axis in (0, 1)]
    centers = [
        (low[0] + (i + 0.5) * step[0], low[1] + (j + 0.5) * step[1]) for i in range(_CELLS) for j in range(_CELLS)
    ]
    reach = math.hypot(*step) / 2.0
    # An edge is at most as long as the diagonal of all cells, so that its samples are at most `reach` apart.
    corners, shares = np.array(area, dtype=float), np.arange(2 * _CELLS)[:, None, None] / (2 * _CELLS)
    edges = corners + shares * (np.roll(corners, -1, axis=0) - corners)
    points = [*edges.reshape(-1, 2), *(center for center in centers if point_in_polygon(*center, area))]
    x, y = np.array(points, dtype=float).T
    nearest = float(roads.locate(x, y, reach=np.inf).outside.min())
    return max(0.0, nearest - reach)


BACK, STEP = 100.0, 5.0
"""Distance before a stop line within which a light should be in view, and steps of the search for such a place [m]."""


def lights_out_of_view(
    scenario: Scenario, settings: Mapping[str, AgentSettings], roads: RoadNetwork | None
) -> Iterator[Diagnostic]:
    """Yield a warning for each driving station that reads traffic lights by itself, and whose cameras show none of the
    map."""
    lines = [line for line in stop_lines(roads) if line.kind == "light"] if roads is not None else []
    for name in possible_drivers(scenario, settings) if lines else ():
        station, spec = settings[name], actor_spec(name, scenario.entities[name])
        if station.obey_signals and not ErrorSubject(f"station {name!r}").call(_can_read, station, spec, roads, lines):
            controller = station_controller(scenario, name)
            yield Diagnostic(
                f"{name!r} passes red lights: its cameras show no traffic light of the map to a vehicle before it",
                "add a camera with a view ahead, or with more pixels",
                controller.source,
                property_line(controller, "sensors", "obey_signals"),
            )


def _can_read(station: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, lights: Sequence[StopLine]) -> bool:
    """Return whether the detector of a station would have one of these lights in view, or takes lights from the map."""
    kind, _ = selected_extension(station, "detector", Detector)
    if "light" not in kind.detectable_signals:
        return True
    detector = build_detector(station)
    sensors = station.rig_sensors(detector.needs, detector.default_sensors)
    detector.setup(DetectorContext(spec, sensors, roads))
    return any(
        detector.can_read_light(
            light.signal,
            light.x - back * math.cos(light.heading),
            light.y - back * math.sin(light.heading),
            light.z,
            light.heading,
        )
        for light in lights
        for back in np.arange(0.0, BACK, STEP).tolist()
    )


def short_channel_delay(
    profile: ChannelProfile | None, dt: float, source: str = "", line: int | None = None
) -> Iterator[Diagnostic]:
    """Yield a warning if most messages of a channel are delayed by less than one step `dt` [s], but by more than 0.

    A message without delay arrives in the next tick by definition of the channel, which is no warning.
    """
    delay: Any = getattr(profile, "delay", None)
    if profile is None or not hasattr(delay, "quantile"):
        return
    median = float(delay.quantile(0.5))
    if 0.0 < median < dt - TIME_TOLERANCE:
        what = "the delay" if isinstance(delay, ConstantDelay) else "the median delay"
        yield Diagnostic(
            f"most messages take one step of {dt:g} s: {what} of the channel {profile.name!r} is only {median:.3g} s",
            "use a smaller step (RunSettings.dt) to resolve it",
            source,
            line,
        )


def short_detector_latencies(settings: Mapping[str, AgentSettings], dt: float) -> Iterator[Diagnostic]:
    """Yield a warning for each station whose detector takes less than one step `dt` [s], but more than 0."""
    for name, station in settings.items():
        if 0.0 < station.detector_latency < dt - TIME_TOLERANCE:
            yield Diagnostic(
                f"detections of {name!r} are known one step of {dt:g} s later: "
                f"its detector_latency is only {station.detector_latency:g} s",
                "use a smaller step (RunSettings.dt) to resolve it",
            )


def fast_message_rates(settings: Mapping[str, AgentSettings], dt: float) -> Iterator[Diagnostic]:
    """Yield a warning for each station that should send more than one message in one step `dt` [s]."""
    for name, station in settings.items():
        rate = station.message_rate
        if rate is not None and rate * dt > 1.0 + TIME_TOLERANCE:
            yield Diagnostic(
                f"{name!r} sends one message in each step of {dt:g} s: its message_rate is {rate:g} Hz",
                "use a smaller step (RunSettings.dt) to resolve it",
            )


def short_views(settings: Mapping[str, AgentSettings], detectors: Mapping[str, Detector]) -> Iterator[Diagnostic]:
    """Yield a warning for each driving station that cannot stop within the range of its sensors from its target
    speed."""
    for name, station in settings.items():
        deceleration = getattr(station.planner_settings, "hard_deceleration", None)
        detector, speed = detectors.get(name), station.target_speed
        if detector is None or deceleration is None or speed is None:
            continue
        sensors = station.rig_sensors(detector.needs, detector.default_sensors).values()
        ranges = [checked_range(detector, sensor) for sensor in sensors if sensor.kind in detector.needs]
        view, needed = max(ranges, default=math.inf), speed * REACTION + speed**2 / (2.0 * deceleration)
        if needed > view:
            yield Diagnostic(
                f"the sensors of {name!r} show a car up to {view:.3g} m: from its target speed of {speed:g} m/s it "
                f"stops within {needed:.0f} m",
                "set a longer 'range', more rays or more pixels of its sensors, or a lower target speed",
            )


LEAST = 1.0
"""Minimum distance from the start that a driving station is expected to reach [m]."""
PATIENCE = 2.0
"""Minimum driving time before a warning [s]: most stations start from rest."""


class MotionlessStations:
    """Observer of driving stations until they are `LEAST` [m] away from their start.

    `watching` is False if no station is left, which saves the call in each tick.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._starts: dict[str, tuple[float, float] | None] = dict.fromkeys(names)
        self._reached: dict[str, float] = {}
        self._since: dict[str, float] = {}
        self.watching = bool(self._starts)

    def observe(self, view: WorldView, drivers: Collection[str]) -> None:
        """Process a view; `drivers` are the stations that drive in this tick."""
        for name, start in list(self._starts.items()):
            row = view.rows.get(name)
            if row is None:
                continue
            x, y = float(view.position[row, 0]), float(view.position[row, 1])
            if start is None:
                self._starts[name] = start = (x, y)
            if name in drivers:
                self._since.setdefault(name, view.time)
                self._reached[name] = max(self._reached.get(name, 0.0), math.hypot(x - start[0], y - start[1]))
            elif view.time - self._since.get(name, math.inf) < PATIENCE:
                # The start of a scripted station is where it begins to drive
                self._starts[name] = None
                self._since.pop(name, None)
                self._reached.pop(name, None)
            if self._reached.get(name, 0.0) >= LEAST:
                del self._starts[name]
                self.watching = bool(self._starts)

    def warnings(self, scenario: Scenario, time: float) -> Iterator[Diagnostic]:
        """Yield a warning for each driving station that did not move until the end of the run at `time` [s]."""
        entities = scenario.document.entities
        lines = {entity.name: entity.line for entity in entities.scenario_object} if entities is not None else {}
        for name in self._starts:
            if name in self._reached and time - self._since[name] >= PATIENCE:
                yield Diagnostic(
                    f"station {name!r} covered only {self._reached[name]:.2f} m in {time:.2f} s",
                    "check its target speed, its route and what it brakes for",
                    str(scenario.path or ""),
                    lines.get(name),
                )
