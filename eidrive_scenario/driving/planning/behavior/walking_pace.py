"""Driving on at walking pace after a wait, past what stands beside the way."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from eidrive_scenario.detections import VULNERABLE
from eidrive_scenario.driving.planning.behavior.maneuvers import LEAST_CLEARANCE
from eidrive_scenario.driving.planning.behavior.options import Options
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.situation import Situation
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings
from eidrive_scenario.tolerances import TIME_TOLERANCE

PACE = 2.0
"""Walking pace [m/s]; in a traffic-calmed area German courts accept 4 to 7 km/h."""
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
        if self._is_active and float(options.rolled.speed[best, self._soon]) > PACE:
            self._is_active = self._drives = False
        return self._is_active and (self._drives or situation.now - self._tried >= RETRY - TIME_TOLERANCE)

    def moves_safely(self, situation: Situation, options: Options, best: int) -> bool:
        """Return whether a proposal moves the vehicle without a collision; else it waits for the next attempt."""
        way = float(options.rolled.s[best, -1] - options.rolled.s[best, 0])
        self._drives = way > MOVES and not math.isfinite(options.evaluation.collision[best])
        self._tried = situation.now
        return self._drives

    def situation(self, situation: Situation) -> Situation:
        """Return the situation with walking pace as the wanted speed."""
        return msgspec.structs.replace(situation, wanted=min(situation.wanted, PACE))

    def scene(self, situation: Situation, scene: Surroundings) -> Surroundings:
        """Return the scene with less margin beside vehicles and obstacles that stand."""
        objects = [situation.objects[owner] for owner in scene.owner]
        stands = np.array([known.still_since is not None and known.kind not in VULNERABLE for known in objects])
        margin = np.where(stands, np.minimum(scene.margin, LEAST_CLEARANCE), scene.margin)
        return msgspec.structs.replace(scene, margin=margin)
