"""Rules about actions: conflicts of control domains, speeds, transitions and trajectory times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.checks.scenario_rules.states import has_zero_rate, never_ends
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario import model

_DOMAINS: Mapping[type[model.Element], str] = {
    model.SpeedAction: "longitudinal",
    model.SpeedProfileAction: "longitudinal",
    model.LongitudinalDistanceAction: "longitudinal",
    model.SynchronizeAction: "longitudinal",
    model.LaneChangeAction: "lateral",
    model.LaneOffsetAction: "lateral",
    model.LateralDistanceAction: "lateral",
    model.FollowTrajectoryAction: "lateral",
}
"""Control domain of each action with a duration (ASAM OpenSCENARIO XML, control strategies)."""

_TRANSITIONS = (
    model.TransitionDynamics
    | model.LaneOffsetActionDynamics
    | model.LongitudinalDistanceAction
    | model.LateralDistanceAction
)
"""Elements that state whether an action takes time."""


def conflicting_actions(context: LintContext) -> Iterator[Diagnostic]:
    """Yield actions of one event that end another one, as both control the same domain of the same entities."""
    for node in context.nodes:
        if not isinstance(node.element, model.Event) or not context.actors(node):
            continue
        domains = [(action, _domains(action)) for action in node.element.action]
        for (first, of_first), (second, of_second) in combinations(domains, 2):
            if shared := of_first & of_second:
                yield at(
                    second,
                    f"action {second.name!r} immediately ends action {first.name!r} of the same event: both control "
                    f"the {' and '.join(sorted(shared))} domain of {', '.join(context.actors(node))}",
                    "start it by a separate event after the end of the other one",
                )


def _domains(action: model.Action) -> set[str]:
    """Return the control domains of a private action that has a duration."""
    elements = () if action.private_action is None else action.private_action.walk()
    leaf = next((element for element in elements if type(element) in _DOMAINS), None)
    if leaf is None:
        return set()
    transitions = (part for part in leaf.walk() if isinstance(part, _TRANSITIONS))
    if any(map(model.is_immediate, transitions)) and not never_ends(action):
        return set()
    domains = {_DOMAINS[type(leaf)]}
    if isinstance(leaf, model.FollowTrajectoryAction) and leaf.time_reference.timing is not None:
        domains.add("longitudinal")
    return domains


def speeds_above_max(context: LintContext) -> Iterator[Diagnostic]:
    """Yield speeds above the maxSpeed of the vehicle, forwards or backwards."""
    for action, actors in context.performances:
        for element in action.walk():
            speed = _speed(element)
            if speed is None or _is_relative(action):
                continue
            for name in actors:
                entity = context.scenario.entities.get(name)
                limit = entity.performance.max_speed if isinstance(entity, model.Vehicle) else None
                if limit is not None and abs(speed) > limit + EPSILON:
                    yield at(
                        element,
                        f"speed {speed:g} m/s of {name!r} exceeds its maxSpeed of {limit:g} m/s",
                        "speeds are in m/s; lower the speed, or raise maxSpeed in Performance",
                    )


def _speed(element: model.Element) -> float | None:
    if isinstance(element, model.AbsoluteTargetSpeed | model.AbsoluteSpeed):
        return element.value
    return element.speed if isinstance(element, model.SpeedProfileEntry) else None


def _is_relative(action: model.PrivateAction) -> bool:
    """Whether the speeds of an action are differences from the speed of another entity."""
    profiles = (part for part in action.walk() if isinstance(part, model.SpeedProfileAction))
    return any(profile.entity_ref is not None or profile.entity_ref_element is not None for profile in profiles)


def zero_rate_transitions(context: LintContext) -> Iterator[Diagnostic]:
    """Yield transitions that never reach their target because their rate is 0."""
    for dynamics in context.of(model.TransitionDynamics):
        if has_zero_rate(dynamics):
            yield at(dynamics, "with a rate of 0 the action never reaches its target", "specify a rate above 0")


def untimed_trajectories(context: LintContext) -> Iterator[Diagnostic]:
    """Yield trajectories with a Timing whose times are missing or all equal."""
    for action in context.of(model.FollowTrajectoryAction):
        if action.time_reference.timing is None:
            continue
        trajectory = context.trajectory(action)
        shape = trajectory.shape.chosen() if trajectory is not None else None
        if isinstance(shape, model.Polyline):
            yield from _times(shape)
        elif shape is not None and not model.has_times(shape):
            name = type(shape).__name__
            message = f"Timing has no effect: this {name} has no times, so the actor keeps its speed"
            hint = f"specify {model.TIME_ATTRIBUTES[type(shape)]}, or write <None/> as the TimeReference"
            yield at(shape, message, hint)


def _times(shape: model.Polyline) -> Iterator[Diagnostic]:
    for vertex in shape.vertex:
        if vertex.time is None:
            message = "Timing has no effect: this vertex has no time, so the actor keeps its speed"
            yield at(vertex, message, f"specify {model.TIME_ATTRIBUTES[model.Polyline]}")
    times = [vertex.time for vertex in shape.vertex if vertex.time is not None]
    if len(times) == len(shape.vertex) and all(time == times[0] for time in times):
        yield at(shape, f"all vertices have the time {times[0]:g} s", "specify when each vertex is passed")
