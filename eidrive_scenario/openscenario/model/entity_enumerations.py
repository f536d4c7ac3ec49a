"""Enumerations of entities, their parts and the environment."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.element import Enumeration, deprecated, only, since


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


class ControllerType(Enumeration):
    """Domains that a controller supports."""

    LATERAL = "lateral"
    LONGITUDINAL = "longitudinal"
    LIGHTING = "lighting"
    ANIMATION = "animation"
    MOVEMENT = "movement"
    APPEARANCE = "appearance"
    ALL = "all"


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


class LightMode(Enumeration):
    """Mode of a light."""

    ON = "on"
    OFF = "off"
    FLASHING = "flashing"


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


class PedestrianCategory(Enumeration):
    """Category of a pedestrian."""

    ANIMAL = "animal"
    PEDESTRIAN = "pedestrian"
    WHEELCHAIR = "wheelchair", deprecated("1.4")


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


class Role(Enumeration):
    """Role of a vehicle or a pedestrian."""

    NONE = "none"
    AGRICULTURE = "agriculture", since("1.4")
    AMBULANCE = "ambulance"
    CIVIL = "civil"
    CONSTRUCTION = "construction", since("1.4")
    DANGEROUS_GOODS_TRANSPORT = "dangerousGoodsTransport", since("1.4")
    FIRE = "fire", deprecated("1.4")
    FIRE_BRIGADE = "fireBrigade", since("1.4")
    FREIGHT_TRANSPORT = "freightTransport", since("1.4")
    GARBAGE_COLLECTION = "garbageCollection", since("1.4")
    MILITARY = "military"
    OTHER = "other", since("1.4")
    POLICE = "police"
    PUBLIC_TRANSPORT = "publicTransport"
    ROAD_ASSISTANCE = "roadAssistance", deprecated("1.4")
    ROADSIDE_ASSISTANCE = "roadsideAssistance", since("1.4")
    SPECIAL_TRANSPORT = "specialTransport", since("1.4")
    TRAFFIC_CONTROL = "trafficControl", since("1.4")


class SensorCategory(Enumeration):
    """Type of a sensor (1.2)."""

    CAMERA = "camera"
    LIDAR = "lidar"
    RADAR = "radar"
    ULTRASONIC = "ultrasonic"


class VehicleCategory(Enumeration):
    """Category of a vehicle."""

    AIRCRAFT = "aircraft", since("1.4")
    BICYCLE = "bicycle"
    BUS = "bus"
    CAR = "car"
    HEAVY_TRUCK = "heavyTruck", since("1.4")
    LAND_VEHICLE = "landVehicle", since("1.4")
    MICROMOBILITY_DEVICE = "micromobilityDevice", since("1.4")
    MOTORBIKE = "motorbike", deprecated("1.4")
    MOTORCYCLE = "motorcycle", since("1.4")
    OTHER = "other", since("1.4")
    SEMITRACTOR = "semitractor", since("1.4")
    SEMITRAILER = "semitrailer"
    STANDUP_SCOOTER = "standupScooter", since("1.4")
    TRAILER = "trailer"
    TRAIN = "train"
    TRAM = "tram"
    TRUCK = "truck", deprecated("1.4")
    VAN = "van"
    WATERCRAFT = "watercraft", since("1.4")
    WHEELCHAIR = "wheelchair", since("1.4")
    WORK_MACHINE = "workMachine", since("1.4")


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
    TAIL_LIGHTS = "tailLights", since("1.4")


class Wetness(Enumeration):
    """Wetness of the road."""

    DRY = "dry"
    MOIST = "moist"
    WET_WITH_PUDDLES = "wetWithPuddles"
    LOW_FLOODED = "lowFlooded"
    HIGH_FLOODED = "highFlooded"
