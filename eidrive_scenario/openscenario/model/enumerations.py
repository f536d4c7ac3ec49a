"""Enumerations of the standard."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.enumeration import Enumeration, deprecated, only, since


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


class CloudState(Enumeration):
    """Cloud state (deprecated since 1.2)."""

    CLOUDY = "cloudy"
    FREE = "free"
    OVERCAST = "overcast"
    RAINY = "rainy"
    SKY_OFF = "skyOff"


class ColorType(Enumeration):
    """Color by name."""

    OTHER = "other"
    RED = "red"
    YELLOW = "yellow"
    GREEN = "green"
    BLUE = "blue"
    VIOLET = "violet"
    ORANGE = "orange"
    BROWN = "brown"
    BLACK = "black"
    GREY = "grey"
    WHITE = "white"


class ConditionEdge(Enumeration):
    """Edge of a condition that fulfills it."""

    FALLING = "falling"
    NONE = "none"
    RISING = "rising"
    RISING_OR_FALLING = "risingOrFalling"


class ControllerType(Enumeration):
    """Domains that a controller supports."""

    LATERAL = "lateral"
    LONGITUDINAL = "longitudinal"
    LIGHTING = "lighting"
    ANIMATION = "animation"
    MOVEMENT = "movement"
    APPEARANCE = "appearance"
    ALL = "all"


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


class FractionalCloudCover(Enumeration):
    """Cloud cover in oktas (eighths of the sky)."""

    ZERO_OKTAS = "zeroOktas"
    ONE_OKTAS = "oneOktas"
    TWO_OKTAS = "twoOktas"
    THREE_OKTAS = "threeOktas"
    FOUR_OKTAS = "fourOktas"
    FIVE_OKTAS = "fiveOktas"
    SIX_OKTAS = "sixOktas"
    SEVEN_OKTAS = "sevenOktas"
    EIGHT_OKTAS = "eightOktas"
    NINE_OKTAS = "nineOktas"


class LateralDisplacement(Enumeration):
    """Lateral displacement relative to the reference entity."""

    ANY = "any"
    LEFT_TO_REFERENCED_ENTITY = "leftToReferencedEntity"
    RIGHT_TO_REFERENCED_ENTITY = "rightToReferencedEntity"


class LightMode(Enumeration):
    """Mode of a light."""

    ON = "on"
    OFF = "off"
    FLASHING = "flashing"


class LongitudinalDisplacement(Enumeration):
    """Longitudinal displacement relative to the reference entity."""

    ANY = "any"
    TRAILING_REFERENCED_ENTITY = "trailingReferencedEntity"
    LEADING_REFERENCED_ENTITY = "leadingReferencedEntity"


class MiscObjectCategory(Enumeration):
    """Category of a miscellaneous object."""

    BARRIER = "barrier"
    BUILDING = "building"
    CROSSWALK = "crosswalk"
    GANTRY = "gantry"
    NONE = "none"
    OBSTACLE = "obstacle"
    PARKING_SPACE = "parkingSpace"
    PATCH = "patch"
    POLE = "pole"
    RAILING = "railing"
    ROAD_MARK = "roadMark"
    SOUND_BARRIER = "soundBarrier"
    STREET_LAMP = "streetLamp"
    TRAFFIC_ISLAND = "trafficIsland"
    TREE = "tree"
    VEGETATION = "vegetation"
    WIND = "wind", deprecated("1.1")


class ObjectType(Enumeration):
    """Type of an entity."""

    MISCELLANEOUS = "miscellaneous"
    PEDESTRIAN = "pedestrian"
    VEHICLE = "vehicle"
    EXTERNAL = "external", since("1.1")
    SENSOR = "sensor", only("1.2")


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


class PedestrianCategory(Enumeration):
    """Category of a pedestrian."""

    ANIMAL = "animal"
    PEDESTRIAN = "pedestrian"
    WHEELCHAIR = "wheelchair"


class PedestrianGestureType(Enumeration):
    """Gesture of a pedestrian."""

    PHONE_CALL_RIGHT_HAND = "phoneCallRightHand"
    PHONE_CALL_LEFT_HAND = "phoneCallLeftHand"
    PHONE_TEXT_RIGHT_HAND = "phoneTextRightHand"
    PHONE_TEXT_LEFT_HAND = "phoneTextLeftHand"
    WAVING_RIGHT_ARM = "wavingRightArm"
    WAVING_LEFT_ARM = "wavingLeftArm"
    UMBRELLA_RIGHT_HAND = "umbrellaRightHand"
    UMBRELLA_LEFT_HAND = "umbrellaLeftHand"
    CROSS_ARMS = "crossArms"
    COFFEE_RIGHT_HAND = "coffeeRightHand"
    COFFEE_LEFT_HAND = "coffeeLeftHand"
    SANDWICH_RIGHT_HAND = "sandwichRightHand"
    SANDWICH_LEFT_HAND = "sandwichLeftHand"


class PedestrianMotionType(Enumeration):
    """Motion of a pedestrian."""

    STANDING = "standing"
    SITTING = "sitting"
    LYING = "lying"
    SQUATTING = "squatting"
    WALKING = "walking"
    RUNNING = "running"
    REELING = "reeling"
    CRAWLING = "crawling"
    CYCLING = "cycling"
    JUMPING = "jumping"
    DUCKING = "ducking"
    BENDING_DOWN = "bendingDown"


class PrecipitationType(Enumeration):
    """Type of precipitation."""

    DRY = "dry"
    RAIN = "rain"
    SNOW = "snow"


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


class Role(Enumeration):
    """Role of a vehicle or a pedestrian."""

    NONE = "none"
    AMBULANCE = "ambulance"
    CIVIL = "civil"
    FIRE = "fire"
    MILITARY = "military"
    POLICE = "police"
    PUBLIC_TRANSPORT = "publicTransport"
    ROAD_ASSISTANCE = "roadAssistance"


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


class SensorCategory(Enumeration):
    """Type of a sensor (1.2)."""

    CAMERA = "camera"
    LIDAR = "lidar"
    RADAR = "radar"
    ULTRASONIC = "ultrasonic"


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


class TriggeringEntitiesRule(Enumeration):
    """Quantifier of triggering entities: all or any must satisfy the condition."""

    ALL = "all"
    ANY = "any"


class VehicleCategory(Enumeration):
    """Category of a vehicle."""

    BICYCLE = "bicycle"
    BUS = "bus"
    CAR = "car"
    MOTORBIKE = "motorbike"
    SEMITRAILER = "semitrailer"
    TRAILER = "trailer"
    TRAIN = "train"
    TRAM = "tram"
    TRUCK = "truck"
    VAN = "van"


class VehicleComponentType(Enumeration):
    """Moving part of a vehicle."""

    HOOD = "hood"
    TRUNK = "trunk"
    DOOR_FRONT_RIGHT = "doorFrontRight"
    DOOR_FRONT_LEFT = "doorFrontLeft"
    DOOR_REAR_RIGHT = "doorRearRight"
    DOOR_REAR_LEFT = "doorRearLeft"
    WINDOW_FRONT_RIGHT = "windowFrontRight"
    WINDOW_FRONT_LEFT = "windowFrontLeft"
    WINDOW_REAR_RIGHT = "windowRearRight"
    WINDOW_REAR_LEFT = "windowRearLeft"
    SIDE_MIRRORS = "sideMirrors"
    SIDE_MIRROR_RIGHT = "sideMirrorRight"
    SIDE_MIRROR_LEFT = "sideMirrorLeft"


class VehicleLightType(Enumeration):
    """Light of a vehicle."""

    DAYTIME_RUNNING_LIGHTS = "daytimeRunningLights"
    LOW_BEAM = "lowBeam"
    HIGH_BEAM = "highBeam"
    FOG_LIGHTS = "fogLights"
    FOG_LIGHTS_FRONT = "fogLightsFront"
    FOG_LIGHTS_REAR = "fogLightsRear"
    BRAKE_LIGHTS = "brakeLights"
    WARNING_LIGHTS = "warningLights"
    INDICATOR_LEFT = "indicatorLeft"
    INDICATOR_RIGHT = "indicatorRight"
    REVERSING_LIGHTS = "reversingLights"
    LICENSE_PLATE_ILLUMINATION = "licensePlateIllumination"
    SPECIAL_PURPOSE_LIGHTS = "specialPurposeLights"


class Wetness(Enumeration):
    """Wetness of the road."""

    DRY = "dry"
    MOIST = "moist"
    WET_WITH_PUDDLES = "wetWithPuddles"
    LOW_FLOODED = "lowFlooded"
    HIGH_FLOODED = "highFlooded"
