"""Actions on how an entity looks: who sees it, and its lights."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api import ActionBehaviour, Domain, LightState, Visibility, model


class VisibilityAction(ActionBehaviour):
    """Says who sees the entity: pictures, traffic, sensors."""

    action: model.VisibilityAction

    def update(self) -> Status:
        """Say it."""
        action = self.action
        self.stage.commands.visibility[self.actor.name] = Visibility(action.graphics, action.traffic, action.sensors)
        return Status.SUCCESS

    def describe(self) -> str:
        """Who sees it."""
        who = (("pictures", self.action.graphics), ("traffic", self.action.traffic), ("sensors", self.action.sensors))
        return f"seen by {', '.join(name for name, seen in who if seen) or 'nobody'}"


class LightStateAction(ActionBehaviour):
    """Switches a light of the vehicle; done when the transition time is over."""

    domains = Domain.LIGHTING
    action: model.LightStateAction

    @property
    def resource(self) -> str:
        """Its light."""
        return self._light(self.action.light_type)

    def initialise(self) -> None:
        """Switch it."""
        state, kind = self.action.light_state, self.action.light_type
        mode = state.mode or state.state
        intensity = state.luminous_intensity if state.luminous_intensity is not None else state.intensity
        self._left = self.action.transition_time or 0.0
        light = LightState(self._light(kind), mode.value if mode is not None else "on", intensity)
        self.stage.commands.lights.setdefault(self.actor.name, []).append(light)

    def update(self) -> Status:
        """Wait for the transition's end."""
        self._left -= self.stage.dt
        return Status.SUCCESS if self._left < 1e-6 else Status.RUNNING

    @staticmethod
    def _light(kind: model.LightType) -> str:
        if kind.vehicle_light is not None:
            return str(kind.vehicle_light.vehicle_light_type.value)
        return kind.user_defined_light.user_defined_light_type if kind.user_defined_light is not None else ""

    def describe(self) -> str:
        """Which light."""
        mode = self.action.light_state.mode or self.action.light_state.state
        return f"{self._light(self.action.light_type)} {mode.value if mode is not None else 'on'}"
