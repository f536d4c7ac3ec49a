"""Actions on how an entity looks: who sees it, its lights, and what moves on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, AnimationState, Domain, LightState, Visibility, model
from eidrive_scenario.api.common import EPSILON

NAMED: Mapping[str, tuple[float, float, float]] = {
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
"""Red, green, blue of the standard's ColorType."""

MOTION = "motion"


class VisibilityAction(ActionBehaviour):
    """Says who sees the entity: pictures, traffic, sensors.

    With a SensorReferenceSet what it says of sensors is for those of these names alone, whosever they are.
    """

    immediate = True
    action: model.VisibilityAction

    def update(self) -> Status:
        """Say it."""
        action, context, name = self.action, self.context, self.actor.name
        before, chosen = context.appearance(name), action.sensor_reference_set
        if chosen is None:
            seen = Visibility(action.graphics, action.traffic, action.sensors)
        else:
            named = {one.name: action.sensors for one in chosen.sensor_reference}
            others = before.visibility
            seen = Visibility(action.graphics, action.traffic, others.sensors, {**others.named, **named})
        context.set_appearance(name, replace(before, visibility=seen))
        return Status.SUCCESS

    def describe(self) -> str:
        """Who sees it."""
        chosen = self.action.sensor_reference_set
        sensors = (
            "sensors" if chosen is None else "the sensors " + ", ".join(one.name for one in chosen.sensor_reference)
        )
        who = (("images", self.action.graphics), ("traffic", self.action.traffic), (sensors, self.action.sensors))
        return f"seen by {', '.join(name for name, seen in who if seen) or 'nobody'}"


class LightStateAction(ActionBehaviour):
    """Switches a light of the vehicle; done when the transition time is over.

    A flashing light never comes to rest: the action goes on until a younger one switches the same light.
    """

    domains = Domain.LIGHTING
    immediate = True
    action: model.LightStateAction

    @property
    def resource(self) -> str:
        """Its light."""
        return self._light

    def initialise(self) -> None:
        """Switch it."""
        state, context, name = self.action.light_state, self.context, self.actor.name
        usual = LightState(self._light, self._mode)
        light = replace(
            usual,
            intensity=state.luminous_intensity if state.luminous_intensity is not None else state.intensity,
            color=rgb(state.color) if state.color is not None else None,
            since=max(context.time, 0.0),
            fade=self.action.transition_time or 0.0,
            on_for=usual.on_for if state.flashing_on_duration is None else state.flashing_on_duration,
            off_for=usual.off_for if state.flashing_off_duration is None else state.flashing_off_duration,
        )
        before = context.appearance(name)
        context.set_appearance(name, replace(before, lights={**before.lights, self._light: light}))
        self._until = light.since + light.fade

    def update(self) -> Status:
        """Wait for the transition's end."""
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
        mode = self.action.light_state.mode or self.action.light_state.state
        return str(mode.value) if mode is not None else "on"

    def describe(self) -> str:
        """Which light."""
        return f"{self._light} {self._mode}"


class AnimationAction(ActionBehaviour):
    """Plays an animation: of a part of a vehicle, of a pedestrian, out of a file, or one that a tool knows.

    Done when its duration is over, at once where it has none; one that loops goes on until another animation of the
    same part takes its place.
    """

    domains = Domain.ANIMATION
    immediate = True
    action: model.AnimationAction

    @property
    def resource(self) -> str:
        """What moves."""
        return self._kind_and_what()[1] if self._kind_and_what()[0] != MOTION else MOTION

    def initialise(self) -> None:
        """Begin it."""
        kind, what = self._kind_and_what()
        context, name = self.context, self.actor.name
        pedestrian = self.action.animation_type.pedestrian_animation
        animation = AnimationState(
            kind,
            what,
            state=self.action.animation_state.state if self.action.animation_state is not None else None,
            since=max(context.time, 0.0),
            duration=self.action.animation_duration,
            loop=bool(self.action.loop),
            gestures=tuple(one.gesture.value for one in pedestrian.pedestrian_gesture) if pedestrian else (),
        )
        before = context.appearance(name)
        context.set_appearance(name, replace(before, animations={**before.animations, self.resource: animation}))
        self._until = math.inf if animation.loop else animation.since + (animation.duration or 0.0)

    def update(self) -> Status:
        """Wait for its end."""
        return Status.SUCCESS if self.context.time > self._until - EPSILON else Status.RUNNING

    def _kind_and_what(self) -> tuple[str, str]:
        kind = self.action.animation_type
        component, pedestrian = kind.component_animation, kind.pedestrian_animation
        if component is not None:
            if component.vehicle_component is not None:
                return "component", str(component.vehicle_component.vehicle_component_type.value)
            own = component.user_defined_component
            return "user component", own.user_defined_component_type if own is not None else ""
        if pedestrian is not None:
            named = str(pedestrian.motion.value) if pedestrian.motion is not None else ""
            return MOTION, named or pedestrian.user_defined_pedestrian_animation or ""
        if kind.animation_file is not None:
            return "file", kind.animation_file.file.filepath
        own_kind = kind.user_defined_animation
        return "user animation", own_kind.user_defined_animation_type if own_kind is not None else ""

    def describe(self) -> str:
        """Which one."""
        kind, what = self._kind_and_what()
        state = self.action.animation_state
        return f"{kind} {what}{f' to {state.state:g}' if state is not None else ''}"


def rgb(color: model.Color) -> tuple[float, float, float] | None:
    """Red, green, blue in [0, 1] of a color; None where it says no numbers and has no name of the standard."""
    if color.color_rgb is not None:
        return color.color_rgb.red, color.color_rgb.green, color.color_rgb.blue
    if color.color_cmyk is not None:
        mixed, rest = color.color_cmyk, 1.0 - color.color_cmyk.key
        return (1.0 - mixed.cyan) * rest, (1.0 - mixed.magenta) * rest, (1.0 - mixed.yellow) * rest
    if color.red is not None and color.green is not None and color.blue is not None:
        return color.red, color.green, color.blue
    name = color.color_type.value if color.color_type is not None else (color.name or "").lower()
    return NAMED.get(name)
