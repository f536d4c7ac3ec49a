"""Top view of a road file, or of a scenario before its run: starts, paths, trigger zones, views of the stations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from contourpy import FillType, contour_generator
from matplotlib.figure import Figure

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.geometry import equidistant, footprint
from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.driving.agent_factory import build_detector
from eidrive_scenario.errors import Diagnostic, InputError, SettingError, quoted, suggestion
from eidrive_scenario.evaluation.lines_of_sight import LinesOfSight
from eidrive_scenario.extensions.library import ROADS_SUFFIX, definition
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.reporting.drawing.canvas import Canvas
from eidrive_scenario.reporting.drawing.labels import write_labels
from eidrive_scenario.reporting.drawing.road_drawing import network_drawing, simplify_line
from eidrive_scenario.reporting.drawing.road_labels import RoadLabels
from eidrive_scenario.reporting.drawing.top_view import (
    AREA,
    FUSED,
    LINK,
    LOST,
    OWN,
    STATION,
    TRUTH,
    WHITE,
    RoadDrawing,
    Window,
)
from eidrive_scenario.reporting.drawing.vector_canvas import Size, scene_figure
from eidrive_scenario.roads import RoadNetwork, Route
from eidrive_scenario.sensing.sensor import view_sectors
from eidrive_scenario.simulation import Simulation
from eidrive_scenario.storyboard.kinematics.route import build_route
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory
from eidrive_scenario.storyboard.positions.resolution import resolve_position
from eidrive_scenario.world.view import WorldView

POINT_HEIGHT = 1.0
"""Height of the points of which the picture shows whether a station sees them, above the ground at the station [m]."""
FARTHEST = 200.0
"""Maximum distance at which shadows are computed [m]."""
RAY_SPACING, ANGLES = 0.5, 720
"""Distance of computed points along a direction [m], and number of directions."""
PATH_SPACING = 1.0
"""Distance of the points of paths [m]."""
MOST_RANGES = 8
"""Maximum number of stations whose sensor ranges are all drawn; of more stations only those of the selected one are."""
LEAST_WIDTH = 60.0
"""Minimum width of the section [m]."""
_MARGIN = 12.0
"""Distance of starts, paths and zones from the edge of the section [m]."""
TOLERANCE = 0.05
"""Maximum deviation of a drawn path or shadow [m]."""


@dataclass(frozen=True)
class PlannedPath:
    """Path (M, 2) that an action lets an actor follow [m]; `kind` is trajectory or route."""

    kind: str
    points: Array


@dataclass(frozen=True)
class TriggerZone:
    """Circle in which a condition on a position holds [m], or beyond which it does, with the name of the condition."""

    name: str
    center: tuple[float, float]
    radius: float


@dataclass(frozen=True)
class ScenarioPicture:
    """Content of the picture of a scenario at its start.

    sectors  sectors of the sensors in the world, by station
    station  station whose shadow is drawn; "" without stations
    shadow   polygons (M, 2) [m]: points within the sensor ranges of this station that it does not see
    areas    conflict areas of planners, polygons (M, 2) [m]
    """

    view: WorldView
    paths: tuple[PlannedPath, ...]
    zones: tuple[TriggerZone, ...]
    sectors: Mapping[str, tuple[ViewSector, ...]]
    station: str
    shadow: tuple[Array, ...]
    areas: tuple[Array, ...]

    @classmethod
    def of(cls, simulation: Simulation, station: str | None = None) -> ScenarioPicture:
        """Return the picture of a simulation before its first tick.

        station  whose shadow is drawn; by default the first that drives, else the first

        Raise SettingError if there is no such station in the world.
        """
        view = simulation.world.view()
        outline = Outline(simulation.scenario)
        sectors = dict(_sectors(simulation, view))
        drivers = [name for name in simulation.stack.possible_drivers if name in sectors]
        if station is not None and station not in sectors:
            raise SettingError(Diagnostic(f"no station {station!r}", suggestion(station, sectors)))
        chosen = station or next(iter([*drivers, *sectors]), "")
        settings = simulation.stack.settings.values()
        areas = [np.array(area) for agent in settings for area in agent.planner_settings.areas]
        shadow = _shadow(simulation, view, chosen, sectors[chosen]) if chosen else ()
        paths, zones = tuple(_paths(simulation, outline)), tuple(_zones(simulation, outline))
        return cls(view, paths, zones, sectors, chosen, tuple(shadow), tuple(areas))

    def section(self, ratio: float) -> Window:
        """Return the section with all starts, paths and zones, in a ratio of width to height."""
        points = [center for center in self.view.boxes[:, :2] if np.isfinite(center).all()]
        for path in self.paths:
            points += [path.points.min(axis=0), path.points.max(axis=0)]
        for zone in self.zones:
            points += [np.array(zone.center) - zone.radius, np.array(zone.center) + zone.radius]
        return Window.enclosing(points or [(0.0, 0.0)], _MARGIN).widened(ratio, LEAST_WIDTH)

    def draw(self, canvas: Canvas, drawing: RoadDrawing, labels: RoadLabels | None) -> None:
        """Draw the scenario on its roads, with the labels of the roads below all other ones."""
        canvas.roads(drawing)
        for polygon in self.shadow:
            canvas.fill(polygon, STATION, 0.25, legend=f"not visible to {self.station}")
        if labels is not None:
            labels.draw(canvas)
        for area in self.areas:
            canvas.fill(area, AREA, 0.2, legend="conflict area")
            canvas.line(area, AREA, 0.15, closed=True)
        for zone in self.zones:
            outline = _circle(zone)
            canvas.fill(outline, LOST, 0.12, legend="trigger zone")
            canvas.line(outline, LOST, 0.0, closed=True)
        for path in self.paths:
            color = FUSED if path.kind == "trajectory" else LINK
            canvas.line(path.points, color, 0.3, legend=path.kind)
        for name, sectors in self.sectors.items():
            if name == self.station or len(self.sectors) <= MOST_RANGES:
                for sector in sectors:
                    canvas.line(sector_outline(sector), OWN, 0.0, closed=True, stroke=1.5, legend="sensor range")
        boxes = self.view.boxes
        shown = np.flatnonzero(np.isfinite(boxes).all(axis=1)).tolist()
        for row in shown:
            is_station = self.view.names[row] in self.sectors
            color, opacity = (STATION, 1.0) if is_station else (WHITE, 0.6)
            canvas.body(boxes[row], color, opacity, legend="station" if is_station else "actor")
        shown.sort(key=lambda row: self.view.names[row] not in self.sectors)
        names = [(self.view.names[row], footprint(boxes[row]), TRUTH) for row in shown]
        names += [(zone.name, _circle(zone), LOST) for zone in self.zones]
        texts, outlines, colors = zip(*names, strict=True) if names else ((), (), ())
        taken = write_labels(canvas, texts, outlines, colors=colors)
        if labels is not None:
            labels.write(canvas, taken)


def sector_outline(sector: ViewSector) -> Array:
    """Return the outline (M, 2) of a sector [m]; one without a range ends at the farthest computed distance."""
    reach = min(sector.range, FARTHEST)
    count = max(2, math.ceil(sector.half_angle / math.pi * 90))
    turn = sector.yaw + np.linspace(-sector.half_angle, sector.half_angle, count)
    arc = np.column_stack([sector.x + reach * np.cos(turn), sector.y + reach * np.sin(turn)])
    return arc if sector.half_angle >= math.pi else np.vstack([arc, [(sector.x, sector.y)]])


def _circle(zone: TriggerZone) -> Array:
    turn = np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False)
    return np.array(zone.center) + max(zone.radius, 0.1) * np.column_stack([np.cos(turn), np.sin(turn)])


def _sectors(simulation: Simulation, view: WorldView) -> Iterator[tuple[str, tuple[ViewSector, ...]]]:
    """Yield the stations that are present, with the sectors of their sensors in the world."""
    for name, settings in simulation.stack.settings.items():
        if name in view:
            detector = build_detector(settings)
            sensors = [
                sensor
                for sensor in settings.rig_sensors(detector.needs, detector.default_sensors).values()
                if any(hasattr(sensor, key) for key in ("range", "fov", "field_of_view"))
            ]
            x, y, z, yaw, *_ = view.states[view.row(name)]
            placed = [sector.placed(x, y, z, yaw) for sector in view_sectors(sensors, simulation.world.spec(name))]
            yield name, tuple(dict.fromkeys(placed))


def _shadow(simulation: Simulation, view: WorldView, station: str, sectors: tuple[ViewSector, ...]) -> Iterator[Array]:
    """Yield polygons (M, 2) of the points within the sectors of a station that none of its sensors sees."""
    if not sectors:
        return
    row, sight = view.row(station), LinesOfSight(simulation.roads)
    reach = min(max(sector.range for sector in sectors), FARTHEST)
    distance = np.linspace(0.0, reach, math.ceil(reach / RAY_SPACING) + 1)[1:]
    turn = view.states[row].yaw + np.linspace(-math.pi, math.pi, ANGLES + 1)
    around = np.stack([np.multiply.outer(np.cos(turn), distance), np.multiply.outer(np.sin(turn), distance)], axis=-1)
    points = np.concatenate([around, np.full((*around.shape[:2], 1), POINT_HEIGHT)], axis=-1)
    points += np.array([sectors[0].x, sectors[0].y, view.states[row].z])
    points = points.reshape(-1, 3)
    covered: Bools = np.zeros(len(points), dtype=bool)
    visible = covered.copy()
    for sector in sectors:
        inside = np.flatnonzero(sector.contains(points[:, 0], points[:, 1]))
        covered[inside] = True
        visible[inside] |= ~sight.hidden_points(view, row, np.array([sector.x, sector.y, sector.z]), points[inside])
    shape = around.shape[:2]
    x, y, dark = (values.reshape(shape) for values in (points[:, 0], points[:, 1], covered & ~visible))
    contours = contour_generator(x, y, dark.astype(float), fill_type=FillType.OuterOffset)
    for polygon, offsets in zip(*contours.filled(0.5, 1.5), strict=True):
        outer, *holes = [polygon[start:end] for start, end in pairwise(offsets)]
        # Holes have the opposite direction: a line to each and back makes one polygon of them
        parts = [part for hole in holes for part in (hole, outer[:1])]
        yield np.concatenate([simplify_line(outer, TOLERANCE), *parts])


def _paths(simulation: Simulation, outline: Outline) -> Iterator[PlannedPath]:
    """Yield the routes that actors have after Init, and the trajectories and later routes of all actions."""
    for actor in simulation.storyboard.context.actors.values():
        goal = actor.goal
        if isinstance(actor.motion.route, Route):
            yield PlannedPath("route", actor.motion.route.polyline(PATH_SPACING)[:, :2])
        elif goal is not None and goal.waypoints is not None:
            yield PlannedPath("route", np.vstack([actor.motion.pose[:2], goal.waypoints[:, :2]]))
    done = {
        id(element) for element in simulation.scenario.storyboard.init.walk() if not isinstance(element, TRAJECTORY)
    }
    for action, actors in outline.performances:
        for element in action.walk():
            if id(element) in done or not isinstance(element, (TRAJECTORY, *ROUTES)):
                continue
            for name in actors:
                with suppress(InputError, ValueError, ArithmeticError):  # a path that depends on the run
                    points = _points(simulation, outline, element, name)
                    if len(points) > 1 and np.isfinite(points).all():
                        kind = "trajectory" if isinstance(element, TRAJECTORY) else "route"
                        yield PlannedPath(kind, simplify_line(points, TOLERANCE))


TRAJECTORY = model.FollowTrajectoryAction
ROUTES = (model.AssignRouteAction, model.AcquirePositionAction)


def _points(
    simulation: Simulation,
    outline: Outline,
    action: model.FollowTrajectoryAction | model.AssignRouteAction | model.AcquirePositionAction,
    name: str,
) -> Array:
    """Return the path (M, 2) of an action of an actor at its start [m]. Raise InputError or ValueError without one."""
    context, roads = simulation.storyboard.context, simulation.roads
    resolve = partial(resolve_position, context=context, actor=name)
    actor = context.actors[name]
    if isinstance(action, model.FollowTrajectoryAction):
        trajectory = outline.trajectory(action)
        if trajectory is None:
            return np.empty((0, 2))
        curve = sample_trajectory(trajectory, lambda position: resolve(position).pose, actor.motion.pose)
        return np.array([curve.at(s)[:2] for s in equidistant(0.0, curve.length, PATH_SPACING)])
    if isinstance(action, model.AcquirePositionAction):
        here, there = context.location(name), resolve(action.position)
        if roads is None or here is None or there.location is None:
            return np.array([actor.motion.pose[:2], there.pose[:2]])
        return roads.route(here, there.location).polyline(PATH_SPACING)[:, :2]
    route = action.route or context.catalog_entry(action.catalog_reference, model.Route, action)
    if roads is None:
        return np.array([resolve(waypoint.position).pose[:2] for waypoint in route.waypoint])
    return build_route(route, roads, resolve, seed=context.seed).polyline(PATH_SPACING)[:, :2]


def _zones(simulation: Simulation, outline: Outline) -> Iterator[TriggerZone]:
    """Yield the zones of all conditions on a position, each once."""
    zones: dict[tuple[float, float, float], str] = {}
    for condition in (element for element in outline.elements if isinstance(element, model.Condition)):
        for element in condition.walk():
            if isinstance(element, model.ReachPositionCondition):
                radius = element.tolerance
            elif isinstance(element, model.DistanceCondition):
                radius = element.value
            else:
                continue
            with suppress(InputError, ValueError):  # a position that depends on the run
                pose = resolve_position(element.position, simulation.storyboard.context).pose
                if math.isfinite(pose.x + pose.y + radius):
                    zones.setdefault((pose.x, pose.y, radius), condition.name)
    for (x, y, radius), name in zones.items():
        yield TriggerZone(name, (x, y), radius)


def is_road_file(path: Path) -> bool:
    """Return whether a file is a road file, not a scenario."""
    return path.suffix.lower() == ROADS_SUFFIX or definition(path) == "roads"


def source_figure(source: Path | Scenario, size: Size, station: str | None = None) -> Figure:
    """Return the picture of a scenario before its run, or of a road file.

    size     width and height [mm]
    station  whose shadow is drawn; by default the first that drives, else the first

    Raise InputError for a file that is invalid, too large or cannot be run, SettingError for a station of a road file.
    """
    if isinstance(source, Scenario) or not is_road_file(source):
        with Simulation(source, load_weights=False) as simulation:
            picture = ScenarioPicture.of(simulation, station)
        roads = network_drawing(simulation.roads)
        labels = RoadLabels(simulation.roads) if simulation.roads is not None else None
        return scene_figure(lambda canvas: picture.draw(canvas, roads, labels), picture.section, size)
    if station is not None:
        raise SettingError(
            Diagnostic(f"a road file has no station (got {quoted(station)})", "give a scenario", str(source))
        )
    network = RoadNetwork.load(source)
    drawing, road_labels = network_drawing(network), RoadLabels(network)
    left, bottom, right, top = network.bounds()

    def draw(canvas: Canvas) -> None:
        canvas.roads(drawing)
        road_labels.draw(canvas)
        road_labels.write(canvas)

    return scene_figure(draw, lambda ratio: Window.enclosing([(left, bottom), (right, top)]).widened(ratio, 20.0), size)
