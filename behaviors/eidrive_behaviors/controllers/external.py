"""A driver outside of the run: the entity stands where it is until somebody says where it goes."""

from __future__ import annotations

from eidrive_scenario.api.actions import ControllerModel


class ExternalDriver(ControllerModel):
    """Stands still, and goes where `Simulation.set_pose` puts the entity: there it is in the next view.

    For controllers that get poses from another program (esmini's ExternalController), or from somebody at the keyboard
    (InteractiveController), and for runs without them. Its speed is the one that comes with the pose.
    """

    accepts_external_poses = True

    def on_activate(self) -> None:
        """Nothing to prepare."""

    def step(self) -> None:
        """Move to the pose that was given since the last step, else stay."""
        name, motion = self.actor.name, self.actor.motion
        given = self.context.external_poses.pop(name, None)
        if not (self.actor.longitudinal or self.actor.lateral):
            return
        motion.speed = 0.0 if given is None else given.speed
        if given is not None:
            motion.move_to(given.pose, land=self.context.roads is not None)

    def compute_speed(self) -> float:
        """That of the last pose [m/s]."""
        return self.actor.motion.speed
