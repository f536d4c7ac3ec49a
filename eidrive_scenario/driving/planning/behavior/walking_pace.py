"""Driving on at walking pace after a wait, past what stands beside the way."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from eidrive_scenario.base.detections import VULNERABLE
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.planning.behavior.maneuvers import LEAST_CLEARANCE, Situation
from eidrive_scenario.driving.planning.behavior.memory import KnownObject
from eidrive_scenario.driving.planning.behavior.prediction import Prediction
from eidrive_scenario.driving.planning.behavior.proposals import WALKING_PACE
from eidrive_scenario.driving.planning.behavior.scoring import Options
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

WAIT = 5.0
"""Time for which the vehicle has stood before it passes at walking pace [s]."""
LESS_UNCERTAIN = 0.5
"""Share of `uncertainty` by which standing objects are enlarged at walking pace: 80 % on one side instead of 95 %."""
STANDS = 0.3
"""Speed below which the vehicle stands [m/s]."""
RETRY = 1.0
"""Time between two attempts while the way is too narrow [s]."""
MOVES = 1.0
"""Distance within the horizon from which on a proposal moves the vehicle [m]."""


class WalkingPace:
    """Whether one vehicle may pass standing vehicles and obstacles at walking pace, with less clearance.

    The errors of distant objects decrease when the vehicle approaches; one that waits for this would wait forever.
    """

    def __init__(self, settings: BehaviorSettings, times: int) -> None:
        self.settings = settings.model_copy(update={"uncertainty": LESS_UNCERTAIN * settings.uncertainty})
        self.exact = settings.model_copy(update={"uncertainty": 0.0})
        self._soon = times // 4
        self._stands_since = math.inf
        self._is_active = False
        self._drives = False
        self._tried = -math.inf

    def is_due(self, situation: Situation, options: Options, best: int) -> bool:
        """Return whether the vehicle has waited, the best proposal does not make it faster than walking pace, and it
        drives at walking pace already or may try to."""
        if situation.speed >= STANDS:
            self._stands_since = math.inf
        elif math.isinf(self._stands_since):
            self._stands_since = situation.now
        self._is_active = self._is_active or situation.now - self._stands_since >= WAIT
        if self._is_active and float(options.rolled.speed[best, self._soon]) > WALKING_PACE:
            self._is_active = self._drives = False
        return self._is_active and (self._drives or situation.now - self._tried >= RETRY - TIME_TOLERANCE)

    def moves_safely(self, situation: Situation, options: Options, best: int) -> bool:
        """Return whether a proposal moves the vehicle without a collision; else it waits for the next attempt."""
        self._drives = options.progress(best) > MOVES and not options.collides(best)
        self._tried = situation.now
        return self._drives

    def situation(self, situation: Situation) -> Situation:
        """Return the situation with walking pace as the wanted speed, and with vehicles and obstacles that stay near
        one place standing at their mean place."""
        objects = [_at_mean_place(known_object, situation.now) for known_object in situation.objects]
        wanted = min(situation.wanted, WALKING_PACE)
        return msgspec.structs.replace(
            situation, wanted=wanted, objects=objects, prediction=_standing(situation.prediction, objects)
        )

    def scene(
        self,
        objects: list[KnownObject],
        scene: Surroundings,
        exact: Surroundings,
        ego: tuple[float, float, float, float],
    ) -> Surroundings:
        """Return the scene with less margin beside vehicles and obstacles that stand.

        The vehicle may pass those beside it at its present distance. Their errors cannot reach it, since it touches
        nothing.

        exact  the same hypotheses without errors of position
        ego    distance along the line of the center of the ego, its offset, half length and half width [m]
        """
        stands = np.array([_stands(objects[owner]) for owner in scene.owner], dtype=bool)
        margin = np.where(stands, np.minimum(scene.margin, LEAST_CLEARANCE), scene.margin)
        center, offset, length, width = ego
        gap, half_width = np.abs(scene.d[:, 0] - offset) - width, exact.half_width[:, 0]
        beside = stands & (gap > half_width) & (np.abs(scene.s[:, 0] - center) < scene.half_length[:, 0] + length)
        limit = np.where(beside, np.maximum(gap - LEAST_CLEARANCE, half_width), np.inf)
        return msgspec.structs.replace(scene, margin=margin, half_width=np.minimum(scene.half_width, limit[:, None]))


def _stands(known_object: KnownObject) -> bool:
    return known_object.still_since is not None and known_object.kind not in VULNERABLE


def _at_mean_place(known_object: KnownObject, now: float) -> KnownObject:
    """Return the object at rest at its mean place if it stays there, else unchanged: velocities of objects that the
    border of an image cuts are noisy."""
    if known_object.kind in VULNERABLE or not known_object.stays(now, WAIT):
        return known_object
    x, y = known_object.mean_place
    still_since = known_object.first_seen if known_object.still_since is None else known_object.still_since
    return msgspec.structs.replace(known_object, x=x, y=y, vx=0.0, vy=0.0, acceleration=0.0, still_since=still_since)


def _standing(prediction: Prediction, objects: list[KnownObject]) -> Prediction:
    """Return the prediction with the objects at rest at their places."""
    owners = [objects[index] for index in prediction.objects]
    stands = np.array([_stands(owner) and owner.speed == 0.0 for owner in owners], dtype=bool)[:, None]
    poses = np.array([(owner.x, owner.y, owner.yaw) for owner in owners]).reshape(-1, 3, 1)
    x, y, yaw = (
        np.where(stands, poses[:, axis], part) for axis, part in enumerate((prediction.x, prediction.y, prediction.yaw))
    )
    return msgspec.structs.replace(prediction, x=x, y=y, yaw=yaw, speed=np.where(stands, 0.0, prediction.speed))
