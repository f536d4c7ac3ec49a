"""Proposals of one decision with their rollouts and evaluations."""

from __future__ import annotations

import msgspec
import numpy as np

from eidrive_scenario.arrays import Bools
from eidrive_scenario.driving.planning.behavior.bounds import WALL
from eidrive_scenario.driving.planning.behavior.lateral import LateralProfile
from eidrive_scenario.driving.planning.behavior.proposals import Proposal, Wall
from eidrive_scenario.driving.planning.behavior.rollout import Rollout
from eidrive_scenario.driving.planning.behavior.scoring import Evaluation

URGENT = 4.0
"""Time before a collision at which the emergency brake may act [s]."""


class Options(msgspec.Struct, frozen=True):
    """Proposals with their rollout and evaluation."""

    profiles: list[LateralProfile]
    proposals: list[Proposal]
    walls: list[list[Wall]]
    rolled: Rollout
    evaluation: Evaluation

    @property
    def gentle(self) -> int:
        """Index of the gentle stop."""
        return next(row for row, proposal in enumerate(self.proposals) if proposal.is_gentle)

    @property
    def emergency(self) -> int:
        """Index of emergency braking on the current course."""
        return next(row for row, proposal in enumerate(self.proposals) if proposal.is_emergency)

    def name_of(self, row: int) -> str:
        """Return the maneuver of a proposal."""
        return self.profiles[self.proposals[row].profile].name

    def best(self, profiles: int | None = None) -> int:
        """Return the index of the proposal with the highest score, among those along the first `profiles`."""
        count = len(self.proposals)
        if profiles is not None:
            count = sum(proposal.profile < profiles for proposal in self.proposals)
        return int(np.argmax(self.evaluation.score[:count]))

    def uncertain_threat(self, best: int, certain: Bools, *, is_hard: bool) -> int:
        """Return the hypothesis of an object of uncertain existence for which a proposal brakes hard; -1 without one.

        certain  (N,) whether the existence of each hypothesis is certain
        is_hard  whether the proposal brakes hard; a collision soon counts as well
        """
        if not (is_hard or float(self.evaluation.collision[best]) < URGENT):
            return -1
        causes = [self.evaluation.cause[best], self.evaluation.cause[self.gentle], *self.rolled.cause[best]]
        for cause in causes:
            row = int(cause)
            if row <= WALL:
                owner = self.walls[best][WALL - row].owner
                row = -1 if owner is None else owner
            if row >= 0 and not certain[row]:
                return row
        return -1
