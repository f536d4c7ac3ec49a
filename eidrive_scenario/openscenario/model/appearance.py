"""Lights and animations."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.declarations import File
from eidrive_scenario.openscenario.model.element import CHOICE, SEQUENCE, Changed, Element
from eidrive_scenario.openscenario.model.entity_enumerations import (
    ColorType,
    LightMode,
    PedestrianGestureType,
    PedestrianMotionType,
    VehicleComponentType,
    VehicleLightType,
)


class ColorRgb(Element):
    """RGB color, components in [0, 1]."""

    red: float
    green: float
    blue: float


class ColorCmyk(Element):
    """CMYK color, components in [0, 1]."""

    cyan: float
    magenta: float
    yellow: float
    key: float


class Color(Element, content=CHOICE):
    """Color by name and by components in [0, 1]."""

    color_type: ColorType
    color_rgb: ColorRgb | None = None
    color_cmyk: ColorCmyk | None = None


class VehicleLight(Element):
    """Light that the standard defines."""

    vehicle_light_type: VehicleLightType


class UserDefinedLight(Element):
    """Light that is specific to a tool."""

    user_defined_light_type: str


class LightType(Element, content=Changed(SEQUENCE, "1.3", CHOICE)):
    """Choice of a light."""

    vehicle_light: VehicleLight | None = None
    user_defined_light: UserDefinedLight | None = None


class LightState(Element):
    """State of a light; luminous intensity [cd], durations [s]."""

    mode: LightMode
    luminous_intensity: float | None = None
    flashing_on_duration: float | None = None
    flashing_off_duration: float | None = None
    color: Color | None = None


class LightStateAction(Element):
    """Action that switches a light; transition time [s]."""

    transition_time: float | None = None
    light_type: LightType
    light_state: LightState


class VehicleComponent(Element):
    """Moving part of a vehicle."""

    vehicle_component_type: VehicleComponentType


class UserDefinedComponent(Element):
    """Moving part that is specific to a tool."""

    user_defined_component_type: str


class ComponentAnimation(Element, content=Changed(SEQUENCE, "1.3", CHOICE)):
    """Choice of a moving part."""

    vehicle_component: VehicleComponent | None = None
    user_defined_component: UserDefinedComponent | None = None


class PedestrianGesture(Element):
    """Gesture of a pedestrian."""

    gesture: PedestrianGestureType


class PedestrianAnimation(Element):
    """Motion and gestures of a pedestrian."""

    motion: PedestrianMotionType | None = None
    user_defined_pedestrian_animation: str | None = None
    pedestrian_gesture: tuple[PedestrianGesture, ...] = ()


class AnimationFile(Element):
    """Animation from a file; time offset [s]."""

    time_offset: float | None = None
    file: File


class UserDefinedAnimation(Element):
    """Animation that is specific to a tool."""

    user_defined_animation_type: str


class AnimationType(Element, content=CHOICE):
    """Choice of an animation."""

    component_animation: ComponentAnimation | None = None
    pedestrian_animation: PedestrianAnimation | None = None
    animation_file: AnimationFile | None = None
    user_defined_animation: UserDefinedAnimation | None = None


class AnimationState(Element):
    """Target state of an animation in [0, 1]."""

    state: float


class AnimationAction(Element):
    """Action that plays an animation; duration [s]."""

    loop: bool | None = None
    animation_duration: float | None = None
    animation_type: AnimationType
    animation_state: AnimationState | None = None


class AppearanceAction(Element, content=Changed(SEQUENCE, "1.3", CHOICE)):
    """Action that changes the appearance of an entity."""

    light_state_action: LightStateAction | None = None
    animation_action: AnimationAction | None = None
