"""Rules on actions: what takes a domain from its neighbor, what is too fast, what never gets anywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.checks.scenario_rules.termination import at_once, has_zero_rate
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario.model import (
    AbsoluteSpeed,
    AbsoluteTargetSpeed,
    Action,
    Clothoid,
    ClothoidSpline,
    Element,
    Event,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    LongitudinalDistanceAction,
    Nurbs,
    Polyline,
    SpeedAction,
    SpeedProfileAction,
    SpeedProfileEntry,
    SynchronizeAction,
    Trajectory,
    TransitionDynamics,
    Vehicle,
)
from eidrive_scenario.openscenario.trajectory_times import has_times

_DOMAINS: Mapping[type[Element], str] = {
    SpeedAction: "longitudinal",
    SpeedProfileAction: "longitudinal",
    LongitudinalDistanceAction: "longitudinal",
    SynchronizeAction: "longitudinal",
    LaneChangeAction: "lateral",
    LaneOffsetAction: "lateral",
    LateralDistanceAction: "lateral",
    FollowTrajectoryAction: "lateral",
}
"""Actions that take time, and what of an entity they control (ASAM OpenSCENARIO XML, control strategies)."""

TIME_ATTRIBUTES: Mapping[type[Element], str] = {
    Clothoid: "startTime and stopTime",
    ClothoidSpline: "timeEnd",
    Nurbs: "each control point a time",
}
"""By shape, the attributes that state its times."""


def conflicting_actions(context: LintContext) -> Iterator[Diagnostic]:
    """Two actions of one event that control the same domain of the same entities: the second ends the first."""
    for node in context.nodes:
        if not isinstance(node.element, Event) or not context.actors(node):
            continue
        lasting = [(action, leaf) for action in node.element.action if (leaf := _lasting(action)) is not None]
        for (first, one), (second, other) in combinations(lasting, 2):
            shared = _controls(one) & _controls(other)
            if shared:
                yield at(
                    second,
                    f"action {second.name!r} ends action {first.name!r} of the same event at once: both control "
                    f"the {' and '.join(sorted(shared))} domain of {', '.join(context.actors(node))}",
                    "let an event of its own start it, when the other has ended",
                )


def _lasting(action: Action) -> Element | None:
    """What a private action does that takes time."""
    if action.private_action is None:
        return None
    leaf = next((one for one in action.private_action.walk() if type(one) in _DOMAINS), None)
    if leaf is None or any(isinstance(one, TransitionDynamics) and at_once(one) for one in leaf.walk()):
        return None
    return leaf


def _controls(leaf: Element) -> set[str]:
    domains = {_DOMAINS[type(leaf)]}
    if isinstance(leaf, FollowTrajectoryAction) and leaf.time_reference.timing is not None:
        domains.add("longitudinal")
    return domains


def too_fast(context: LintContext) -> Iterator[Diagnostic]:
    """A speed beyond the maxSpeed of the vehicle that shall drive it, forwards or backwards."""
    for action, actors in context.performances:
        for element in action.walk():
            speed = _speed(element)
            if speed is None:
                continue
            for name in actors:
                body = context.scenario.entities.get(name)
                limit = body.performance.max_speed if isinstance(body, Vehicle) else None
                if limit is not None and abs(speed) > limit + 1e-9:
                    yield at(
                        element,
                        f"{speed:g} m/s is asked of {name!r}, whose maxSpeed is {limit:g} m/s",
                        "speeds are in m/s; lower it, or raise maxSpeed of the vehicle's Performance",
                    )


def _speed(element: Element) -> float | None:
    if isinstance(element, AbsoluteTargetSpeed | AbsoluteSpeed):
        return element.value
    return element.speed if isinstance(element, SpeedProfileEntry) else None


def no_progress(context: LintContext) -> Iterator[Diagnostic]:
    """A transition at the rate 0 never reaches its target."""
    for element in context.elements:
        if isinstance(element, TransitionDynamics) and has_zero_rate(element):
            yield at(element, "at a rate of 0 the action never reaches its target", "give a rate above 0")


def untimed_trajectories(context: LintContext) -> Iterator[Diagnostic]:
    """Times that count, and are not there or all the same."""
    for element in context.elements:
        if not isinstance(element, FollowTrajectoryAction) or element.time_reference.timing is None:
            continue
        trajectory = _trajectory(element, context)
        shape = trajectory.shape.chosen() if trajectory is not None else None
        if isinstance(shape, Polyline):
            yield from _times(shape)
        elif shape is not None and not has_times(shape):
            name = type(shape).__name__
            what = f"the Timing has nothing to scale: this {name} has no times, so the actor keeps its own speed"
            yield at(shape, what, f"give {TIME_ATTRIBUTES[type(shape)]}, or write <None/> for the TimeReference")


def _times(shape: Polyline) -> Iterator[Diagnostic]:
    for vertex in shape.vertex:
        if vertex.time is None:
            what = "the Timing has nothing to scale: this vertex has no time, so the actor keeps its own speed"
            yield at(vertex, what, "give each vertex a time")
    known = [vertex.time for vertex in shape.vertex if vertex.time is not None]
    if len(known) == len(shape.vertex) and all(time == known[0] for time in known):
        yield at(shape, f"all its vertices have the time {known[0]:g} s", "say when each vertex is passed")


def _trajectory(action: FollowTrajectoryAction, context: LintContext) -> Trajectory | None:
    given = action.trajectory_ref or action
    if given.trajectory is not None or given.catalog_reference is None:
        return given.trajectory
    entry = context.scenario.entries.get(given.catalog_reference)
    return entry if isinstance(entry, Trajectory) else None
