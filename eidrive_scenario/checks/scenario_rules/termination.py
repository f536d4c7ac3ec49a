"""Actions that do not end by themselves."""

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
    """Return why an action does not end by itself; "" if it may."""
    for element in action.walk():
        if isinstance(element, _CONTINUOUS) and element.continuous:
            return f"{type(element).__name__} is continuous"
        if isinstance(element, TransitionDynamics) and has_zero_rate(element):
            return f"its rate is {element.value:g}"
    return ""


def has_zero_rate(dynamics: TransitionDynamics) -> bool:
    """Whether a transition never reaches its target because its rate is 0."""
    by_rate = dynamics.dynamics_dimension is DynamicsDimension.RATE and dynamics.value == 0.0
    return by_rate and dynamics.dynamics_shape is not DynamicsShape.STEP


def is_immediate(dynamics: TransitionDynamics) -> bool:
    """Whether a transition ends at its start."""
    is_zero = dynamics.dynamics_dimension is not DynamicsDimension.RATE and dynamics.value == 0.0
    return dynamics.dynamics_shape is DynamicsShape.STEP or is_zero
