"""Lights and animations."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.content import CHOICE, SEQUENCE, Changed
from eidrive_scenario.openscenario.model.element import Element, attribute, child
from eidrive_scenario.openscenario.model.enumerations import (
    ColorType,
    LightMode,
    PedestrianGestureType,
    PedestrianMotionType,
    VehicleComponentType,
    VehicleLightType,
)
from eidrive_scenario.openscenario.model.properties import File


@dataclass(frozen=True, kw_only=True)
class ColorRgb(Element):
    """Red, green, blue in [0, 1]."""

    red: float
    green: float
    blue: float


@dataclass(frozen=True, kw_only=True)
class ColorCmyk(Element):
    """Cyan, magenta, yellow, key in [0, 1]."""

    cyan: float
    magenta: float
    yellow: float
    key: float


@dataclass(frozen=True, kw_only=True)
class Color(Element, content=CHOICE):
    """A color by name and, if need be, by numbers in [0, 1]."""

    name: str | None = attribute(until="1.2", required=True)
    red: float | None = attribute(until="1.2")
    green: float | None = attribute(until="1.2")
    blue: float | None = attribute(until="1.2")
    color_type: ColorType | None = attribute(since="1.3", required=True)
    color_rgb: ColorRgb | None = child(since="1.3")
    color_cmyk: ColorCmyk | None = child(since="1.3")


@dataclass(frozen=True, kw_only=True)
class VehicleLight(Element):
    """A light that the standard knows."""

    vehicle_light_type: VehicleLightType


@dataclass(frozen=True, kw_only=True)
class UserDefinedLight(Element):
    """A light that a tool knows."""

    user_defined_light_type: str


@dataclass(frozen=True, kw_only=True)
class LightType(Element, content=Changed(SEQUENCE, "1.3", CHOICE)):
    """Which light."""

    vehicle_light: VehicleLight | None = child(required_until="1.2")
    user_defined_light: UserDefinedLight | None = child(required_until="1.2")


@dataclass(frozen=True, kw_only=True)
class LightState(Element):
    """On, off or flashing; intensity [cd], durations [s]."""

    state: LightMode | None = attribute(until="1.2", required=True)
    intensity: float | None = attribute(until="1.2")
    flashing_on_duration: float | None = None
    flashing_off_duration: float | None = None
    mode: LightMode | None = attribute(since="1.3", required=True)
    luminous_intensity: float | None = attribute(since="1.3")
    color: Color | None = None


@dataclass(frozen=True, kw_only=True)
class LightStateAction(Element):
    """Switches a light; transition time [s]."""

    name: str | None = attribute(until="1.2", required=True)
    transition_time: float | None = None
    light_type: LightType
    light_state: LightState


@dataclass(frozen=True, kw_only=True)
class VehicleComponent(Element):
    """A part of a vehicle that moves."""

    vehicle_component_type: VehicleComponentType


@dataclass(frozen=True, kw_only=True)
class UserDefinedComponent(Element):
    """A moving part that a tool knows."""

    user_defined_component_type: str


@dataclass(frozen=True, kw_only=True)
class ComponentAnimation(Element, content=Changed(SEQUENCE, "1.3", CHOICE)):
    """Which part moves."""

    vehicle_component: VehicleComponent | None = child(required_until="1.2")
    user_defined_component: UserDefinedComponent | None = child(required_until="1.2")


@dataclass(frozen=True, kw_only=True)
class PedestrianGesture(Element):
    """What a pedestrian does with its hands."""

    gesture: PedestrianGestureType


@dataclass(frozen=True, kw_only=True)
class PedestrianAnimation(Element):
    """How a pedestrian moves."""

    motion: PedestrianMotionType | None = None
    user_defined_pedestrian_animation: str | None = None
    pedestrian_gesture: tuple[PedestrianGesture, ...] = ()


@dataclass(frozen=True, kw_only=True)
class AnimationFile(Element):
    """An animation from a file; time offset [s]."""

    time_offset: float | None = None
    file: File


@dataclass(frozen=True, kw_only=True)
class UserDefinedAnimation(Element):
    """An animation that a tool knows."""

    user_defined_animation_type: str


@dataclass(frozen=True, kw_only=True)
class AnimationType(Element, content=CHOICE):
    """Which animation."""

    component_animation: ComponentAnimation | None = None
    pedestrian_animation: PedestrianAnimation | None = None
    animation_file: AnimationFile | None = None
    user_defined_animation: UserDefinedAnimation | None = None


@dataclass(frozen=True, kw_only=True)
class AnimationState(Element):
    """How far the animation has to go, in [0, 1]."""

    state: float


@dataclass(frozen=True, kw_only=True)
class AnimationAction(Element):
    """Plays an animation; duration [s]."""

    name: str | None = attribute(until="1.2", required=True)
    loop: bool | None = None
    animation_duration: float | None = None
    animation_type: AnimationType
    animation_state: AnimationState | None = None


@dataclass(frozen=True, kw_only=True)
class AppearanceAction(Element, content=Changed(SEQUENCE, "1.3", CHOICE)):
    """Changes how an entity looks."""

    light_state_action: LightStateAction | None = child(required_until="1.2")
    animation_state_action: AnimationAction | None = child(until="1.2", required=True)
    animation_action: AnimationAction | None = child(since="1.3")
