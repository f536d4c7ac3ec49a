"""Enumerations of actions, conditions, positions and declarations."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.element import Enumeration, deprecated, since


class AngleType(Enumeration):
    """Kind of angle: heading, pitch or roll."""

    HEADING = "heading"
    PITCH = "pitch"
    ROLL = "roll"


class AutomaticGearType(Enumeration):
    """Lever position: neutral, park, reverse or drive."""

    N = "n"
    P = "p"
    R = "r"
    D = "d"


class ConditionEdge(Enumeration):
    """Edge of a condition that fulfills it."""

    FALLING = "falling"
    NONE = "none"
    RISING = "rising"
    RISING_OR_FALLING = "risingOrFalling"


class CoordinateSystem(Enumeration):
    """Coordinate system in which a distance is measured."""

    ENTITY = "entity"
    LANE = "lane"
    ROAD = "road"
    TRAJECTORY = "trajectory"
    WORLD = "world", since("1.3")


class DirectionalDimension(Enumeration):
    """Axis of the entity along which a quantity is measured."""

    LONGITUDINAL = "longitudinal"
    LATERAL = "lateral"
    VERTICAL = "vertical"


class DynamicsDimension(Enumeration):
    """Dimension of the value of a transition: distance [m], time [s] or rate."""

    DISTANCE = "distance"
    RATE = "rate"
    TIME = "time"


class DynamicsShape(Enumeration):
    """Shape of the transition of a value to its target."""

    CUBIC = "cubic"
    LINEAR = "linear"
    SINUSOIDAL = "sinusoidal"
    STEP = "step"


class FollowingMode(Enumeration):
    """Mode of following: exactly, or within the limits of the vehicle."""

    FOLLOW = "follow"
    POSITION = "position"


class LaneLayerType(Enumeration):
    """Layer of the lanes of a map, such as the temporary lanes of a work zone."""

    PERMANENT = "permanent"
    TEMPORARY = "temporary"


class LateralDisplacement(Enumeration):
    """Lateral displacement relative to the reference entity."""

    ANY = "any"
    LEFT_TO_REFERENCED_ENTITY = "leftToReferencedEntity"
    RIGHT_TO_REFERENCED_ENTITY = "rightToReferencedEntity"


class LongitudinalDisplacement(Enumeration):
    """Longitudinal displacement relative to the reference entity."""

    ANY = "any"
    TRAILING_REFERENCED_ENTITY = "trailingReferencedEntity"
    LEADING_REFERENCED_ENTITY = "leadingReferencedEntity"


class ParameterType(Enumeration):
    """Type of a parameter or a variable."""

    BOOLEAN = "boolean"
    DATE_TIME = "dateTime"
    DOUBLE = "double"
    INTEGER = "integer", deprecated("1.2")
    STRING = "string"
    UNSIGNED_INT = "unsignedInt"
    UNSIGNED_SHORT = "unsignedShort"
    INT = "int", since("1.2")


class Priority(Enumeration):
    """Effect of an event on the other running events of its maneuver."""

    OVERWRITE = "overwrite", deprecated("1.2")
    OVERRIDE = "override", since("1.2")
    PARALLEL = "parallel"
    SKIP = "skip"


class ReferenceContext(Enumeration):
    """Reference of a value: absolute or relative."""

    ABSOLUTE = "absolute"
    RELATIVE = "relative"


class RelativeDistanceType(Enumeration):
    """Direction along which a distance is measured."""

    LATERAL = "lateral"
    LONGITUDINAL = "longitudinal"
    CARTESIAN_DISTANCE = "cartesianDistance", deprecated("1.1")
    EUCLIDIAN_DISTANCE = "euclidianDistance", since("1.1")


class RouteStrategy(Enumeration):
    """Strategy of the routing to a waypoint."""

    FASTEST = "fastest"
    LEAST_INTERSECTIONS = "leastIntersections"
    RANDOM = "random"
    SHORTEST = "shortest"


class RoutingAlgorithm(Enumeration):
    """Strategy of the routing along which a distance is measured."""

    ASSIGNED_ROUTE = "assignedRoute"
    FASTEST = "fastest"
    LEAST_INTERSECTIONS = "leastIntersections"
    SHORTEST = "shortest"
    UNDEFINED = "undefined"


class Rule(Enumeration):
    """Comparison of two values."""

    EQUAL_TO = "equalTo"
    GREATER_THAN = "greaterThan"
    LESS_THAN = "lessThan"
    GREATER_OR_EQUAL = "greaterOrEqual", since("1.1")
    LESS_OR_EQUAL = "lessOrEqual", since("1.1")
    NOT_EQUAL_TO = "notEqualTo", since("1.1")


class SpeedTargetValueType(Enumeration):
    """Whether a relative speed is a difference or a factor."""

    DELTA = "delta"
    FACTOR = "factor"


class StoryboardElementState(Enumeration):
    """State or transition of a storyboard element."""

    COMPLETE_STATE = "completeState"
    END_TRANSITION = "endTransition"
    RUNNING_STATE = "runningState"
    SKIP_TRANSITION = "skipTransition"
    STANDBY_STATE = "standbyState"
    START_TRANSITION = "startTransition"
    STOP_TRANSITION = "stopTransition"


class StoryboardElementType(Enumeration):
    """Level of the storyboard."""

    ACT = "act"
    ACTION = "action"
    EVENT = "event"
    MANEUVER = "maneuver"
    MANEUVER_GROUP = "maneuverGroup"
    STORY = "story"


class TrafficSignalSemantics(Enumeration):
    """Meaning of a phase of a signal controller."""

    ATTENTION_GO = "attention_go"
    ATTENTION_STOP = "attention_stop"
    CAUTION = "caution"
    FALLBACK = "fallback"
    GO = "go"
    STOP = "stop"


class TriggeringEntitiesRule(Enumeration):
    """Quantifier of triggering entities: all or any must satisfy the condition."""

    ALL = "all"
    ANY = "any"
