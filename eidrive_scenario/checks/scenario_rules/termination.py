"""Which actions go on until something else takes over."""

from __future__ import annotations

from eidrive_scenario.openscenario.model import (
    Action,
    DynamicsDimension,
    DynamicsShape,
    LaneOffsetAction,
    LateralDistanceAction,
    LongitudinalDistanceAction,
    RelativeTargetSpeed,
    TransitionDynamics,
)

_CONTINUOUS = (LaneOffsetAction, LateralDistanceAction, LongitudinalDistanceAction, RelativeTargetSpeed)


def never_ends(action: Action) -> str:
    """Why an action never reaches an end of its own, "" where it may."""
    for element in action.walk():
        if isinstance(element, _CONTINUOUS) and element.continuous:
            return f"{type(element).__name__} is continuous"
        if isinstance(element, TransitionDynamics) and has_zero_rate(element):
            return f"its rate is {element.value:g}"
    return ""


def has_zero_rate(dynamics: TransitionDynamics) -> bool:
    """Whether a transition never gets anywhere, as its rate is 0."""
    by_rate = dynamics.dynamics_dimension is DynamicsDimension.RATE and dynamics.value == 0.0
    return by_rate and dynamics.dynamics_shape is not DynamicsShape.STEP


def at_once(dynamics: TransitionDynamics) -> bool:
    """Whether a transition is over as soon as it begins."""
    in_no_time = dynamics.dynamics_dimension is not DynamicsDimension.RATE and dynamics.value == 0.0
    return dynamics.dynamics_shape is DynamicsShape.STEP or in_no_time
