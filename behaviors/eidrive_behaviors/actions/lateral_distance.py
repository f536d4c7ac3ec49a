"""LateralDistanceAction: keep a lateral distance to an entity."""

from __future__ import annotations

import math

from py_trees.common import Status

from eidrive_scenario.api import ActionBehaviour, Domain, Steering, distance, frame_of, model

REACHED = 0.01
"""So near to the wanted distance an action that is not continuous ends [m]."""


class LateralDistanceAction(ActionBehaviour):
    """Keeps `distance` metres beside an entity, on the side that `displacement` names (any: where the actor is).

    The actor goes sideways as fast as its DynamicConstraints let it, and brakes so as to arrive without overshoot;
    without constraints it is at its place at once.
    """

    domains = Domain.LATERAL
    action: model.LateralDistanceAction

    def initialise(self) -> None:
        """Decide on the side."""
        self._rate = 0.0
        if self.actor.motion.location is None:
            self.actor.motion.land()
        displacement = self.action.displacement
        if displacement is model.LateralDisplacement.LEFT_TO_REFERENCED_ENTITY:
            self._side = 1.0
        elif displacement is model.LateralDisplacement.RIGHT_TO_REFERENCED_ENTITY:
            self._side = -1.0
        else:
            self._side = -1.0 if self._beside() > 0.0 else 1.0

    def update(self) -> Status:
        """The offset at the end of the step."""
        motion, dt = self.actor.motion, self.stage.dt
        here, roads = motion.location, self.stage.roads
        if self.actor.driven or self.action.entity_ref not in self.stage.view or here is None or roads is None:
            return Status.RUNNING if self.action.continuous else Status.SUCCESS
        wanted = self._side * (self.action.distance or 0.0)
        error = wanted + self._beside()
        if math.isnan(error):
            return Status.RUNNING
        sideways = self._sideways(error, dt)
        offset = here.offset * roads.driving_direction(here.road, here.lane) + sideways
        motion.steer(Steering(offset, None if abs(motion.speed) > 1e-6 else 0.0, slows=False))
        arrived = abs(error - sideways) < REACHED
        return Status.SUCCESS if arrived and not self.action.continuous else Status.RUNNING

    def _sideways(self, error: float, dt: float) -> float:
        """Metres to the left in this step."""
        limits = self.action.dynamic_constraints
        if limits is None or dt == 0.0:
            return error if limits is None else 0.0
        top = math.inf if limits.max_speed is None else limits.max_speed
        faster = math.inf if limits.max_acceleration is None else limits.max_acceleration
        slower = faster if limits.max_deceleration is None else limits.max_deceleration
        rate = min(top, abs(error) / dt)
        if math.isfinite(slower):
            rate = min(rate, math.sqrt(2.0 * slower * abs(error)))
        rate = math.copysign(rate, error)
        if math.isfinite(faster):
            rate = min(max(rate, self._rate - faster * dt), self._rate + faster * dt)
        self._rate = rate
        return rate * dt

    def _beside(self) -> float:
        """How far the other is to the left [m]."""
        return distance(
            self.stage,
            self.actor.name,
            self.action.entity_ref,
            frame=frame_of(self.action.coordinate_system),
            kind="lateral",
            freespace=self.action.freespace,
        )

    def describe(self) -> str:
        """Distance, and to whom."""
        held = "keep" if self.action.continuous else "reach"
        return f"{held} {self.action.distance or 0.0:g} m beside {self.action.entity_ref}"
