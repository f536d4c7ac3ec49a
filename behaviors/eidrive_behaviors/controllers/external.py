"""A driver outside of the run: the entity stands where it is until somebody says where it goes."""

from __future__ import annotations

from eidrive_scenario.api import StandIn


class ExternalDriver(StandIn):
    """Stands still, and goes where `Simulation.set_pose` puts the entity: there it is in the next view.

    For controllers that get poses from another program (esmini's ExternalController), or from somebody at the keyboard
    (InteractiveController), and for runs without them. Its speed is the one that comes with the pose.
    """

    takes_poses = True

    def begin(self) -> None:
        """Nothing to prepare."""

    def step(self) -> None:
        """Move to the pose that was given since the last step, else stay."""
        name, motion = self.actor.name, self.actor.motion
        given = self.stage.given_poses.pop(name, None)
        if not (self.actor.longitudinal or self.actor.lateral):
            return
        motion.speed = 0.0 if given is None else given.speed
        if given is not None:
            motion.go_to(given.pose, land=self.stage.roads is not None)

    def speed(self) -> float:
        """That of the last pose [m/s]."""
        return self.actor.motion.speed
