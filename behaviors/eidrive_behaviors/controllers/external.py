"""External controller: the entity keeps its pose until another program sets one."""

from __future__ import annotations

from eidrive_scenario.api.actions import ControllerModel


class ExternalDriver(ControllerModel):
    """Standstill, or the pose of `Simulation.set_pose`, which applies in the next view.

    It is the controller model for poses of another program (esmini's ExternalController) or of keyboard input
    (InteractiveController), and for runs without them. Its speed is that of the last pose.
    """

    accepts_external_poses = True

    def on_activate(self) -> None:
        """Do nothing: the controller has no state."""

    def step(self) -> None:
        """Move to the pose that was set since the last step, else stand still."""
        name, motion = self.actor.name, self.actor.motion
        given = self.context.take_external_pose(name)
        if not (self.actor.longitudinal or self.actor.lateral):
            return
        motion.set_speed(0.0 if given is None else given.speed)
        if given is not None:
            motion.move_to(given.pose, land=self.context.roads is not None)

    def compute_speed(self) -> float:
        """Return the speed of the last pose [m/s]."""
        return self.actor.motion.speed
