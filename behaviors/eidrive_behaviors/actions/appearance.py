"""Actions on the appearance of an entity: visibility, lights and animations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, AnimationState, Domain, LightState, Visibility, model
from eidrive_scenario.api.common import EPSILON

COLORS: Mapping[str, tuple[float, float, float]] = {
    "red": (1.0, 0.0, 0.0),
    "yellow": (1.0, 1.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
    "violet": (0.56, 0.0, 1.0),
    "orange": (1.0, 0.5, 0.0),
    "brown": (0.6, 0.3, 0.0),
    "black": (0.0, 0.0, 0.0),
    "grey": (0.5, 0.5, 0.5),
    "white": (1.0, 1.0, 1.0),
}
"""RGB values of the standard's ColorType, each in [0, 1]."""

PARTS: Mapping[str, tuple[str, ...]] = {"fogLights": ("fogLightsFront", "fogLightsRear")}
"""Lights of the standard that a light of the standard comprises."""
MOTION = "motion"


class VisibilityAction(ActionBehaviour):
    """Visibility of an entity in images, in traffic and to sensors.

    A SensorReferenceSet limits the value for sensors to sensors of the listed names, whichever entity carries them.
    """

    immediate = True
    action: model.VisibilityAction

    def update(self) -> Status:
        """Set the visibility."""
        action, context, name = self.action, self.context, self.actor.name
        before, references = context.appearance(name), action.sensor_reference_set
        if references is None:
            visibility = Visibility(action.graphics, action.traffic, action.sensors)
        else:
            named = {reference.name: action.sensors for reference in references.sensor_reference}
            others = before.visibility
            visibility = Visibility(action.graphics, action.traffic, others.sensors, {**others.named, **named})
        context.set_appearance(name, replace(before, visibility=visibility))
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe in which of the three the entity is visible."""
        references = self.action.sensor_reference_set
        names = [] if references is None else [reference.name for reference in references.sensor_reference]
        sensors = "sensors" if references is None else "the sensors " + ", ".join(names)
        observers = (("images", self.action.graphics), ("traffic", self.action.traffic), (sensors, self.action.sensors))
        return f"seen by {', '.join(name for name, visible in observers if visible) or 'nothing'}"


class LightStateAction(ActionBehaviour):
    """Switch of a vehicle light. It is complete at the end of the transition time.

    A flashing light has no final state: the action lasts until a later one switches the same light.
    """

    domains = Domain.LIGHTING
    immediate = True
    action: model.LightStateAction

    @property
    def resources(self) -> tuple[str, ...]:
        """Names of the lights."""
        return PARTS.get(self._light, (self._light,))

    def initialise(self) -> None:
        """Switch the light."""
        state, context, name = self.action.light_state, self.context, self.actor.name
        default = LightState(self._light, self._mode)
        light = replace(
            default,
            intensity=state.luminous_intensity,
            color=rgb(state.color) if state.color is not None else None,
            since=max(context.time, 0.0),
            fade=self.action.transition_time or 0.0,
            on_for=default.on_for if state.flashing_on_duration is None else state.flashing_on_duration,
            off_for=default.off_for if state.flashing_off_duration is None else state.flashing_off_duration,
        )
        before = context.appearance(name)
        switched = {kind: replace(light, light=kind) for kind in self.resources}
        context.set_appearance(name, replace(before, lights={**before.lights, **switched}))
        self._until = light.since + light.fade

    def update(self) -> Status:
        """Wait for the end of the transition."""
        over = self.context.time > self._until - EPSILON and self._mode != model.LightMode.FLASHING.value
        return Status.SUCCESS if over else Status.RUNNING

    @property
    def _light(self) -> str:
        kind = self.action.light_type
        if kind.vehicle_light is not None:
            return str(kind.vehicle_light.vehicle_light_type.value)
        return kind.user_defined_light.user_defined_light_type if kind.user_defined_light is not None else ""

    @property
    def _mode(self) -> str:
        return str(self.action.light_state.mode.value)

    def describe(self) -> str:
        """Describe the light and its mode."""
        return f"{self._light} {self._mode}"


class AnimationAction(ActionBehaviour):
    """Animation of a vehicle component or a pedestrian, from a file, or of a user-defined type.

    It is complete at the end of its duration, and at once without a duration. A looped animation lasts until another
    animation of the same component starts.
    """

    domains = Domain.ANIMATION
    immediate = True
    action: model.AnimationAction

    @property
    def resources(self) -> tuple[str, ...]:
        """Animated component, or `motion` for a pedestrian."""
        kind, target = self._kind_and_target()
        return (MOTION if kind == MOTION else target,)

    def initialise(self) -> None:
        """Start the animation."""
        kind, target = self._kind_and_target()
        context, name = self.context, self.actor.name
        pedestrian = self.action.animation_type.pedestrian_animation
        gestures = pedestrian.pedestrian_gesture if pedestrian else ()
        animation = AnimationState(
            kind,
            target,
            state=self.action.animation_state.state if self.action.animation_state is not None else None,
            since=max(context.time, 0.0),
            duration=self.action.animation_duration,
            loop=bool(self.action.loop),
            gestures=tuple(gesture.gesture.value for gesture in gestures),
        )
        before = context.appearance(name)
        animations = {**before.animations, **dict.fromkeys(self.resources, animation)}
        context.set_appearance(name, replace(before, animations=animations))
        self._until = math.inf if animation.loop else animation.since + (animation.duration or 0.0)

    def update(self) -> Status:
        """Wait for the end of the animation."""
        return Status.SUCCESS if self.context.time > self._until - EPSILON else Status.RUNNING

    def _kind_and_target(self) -> tuple[str, str]:
        kind = self.action.animation_type
        component, pedestrian = kind.component_animation, kind.pedestrian_animation
        if component is not None:
            if component.vehicle_component is not None:
                return "component", str(component.vehicle_component.vehicle_component_type.value)
            custom = component.user_defined_component
            return "user component", custom.user_defined_component_type if custom is not None else ""
        if pedestrian is not None:
            named = str(pedestrian.motion.value) if pedestrian.motion is not None else ""
            return MOTION, named or pedestrian.user_defined_pedestrian_animation or ""
        if kind.animation_file is not None:
            return "file", kind.animation_file.file.filepath
        custom_kind = kind.user_defined_animation
        return "user animation", custom_kind.user_defined_animation_type if custom_kind is not None else ""

    def describe(self) -> str:
        """Describe the animation and its target state."""
        kind, target = self._kind_and_target()
        state = self.action.animation_state
        return f"{kind} {target}{f' to {state.state:g}' if state is not None else ''}"


def rgb(color: model.Color) -> tuple[float, float, float] | None:
    """Return red, green and blue of a color, each in [0, 1]; None without values and without a standard name."""
    if color.color_rgb is not None:
        return color.color_rgb.red, color.color_rgb.green, color.color_rgb.blue
    if color.color_cmyk is not None:
        mixed, rest = color.color_cmyk, 1.0 - color.color_cmyk.key
        return (1.0 - mixed.cyan) * rest, (1.0 - mixed.magenta) * rest, (1.0 - mixed.yellow) * rest
    return COLORS.get(color.color_type.value)
