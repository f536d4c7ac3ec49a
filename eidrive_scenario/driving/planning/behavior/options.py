"""Proposals of one decision with their rollouts and evaluations."""

from __future__ import annotations

from typing import TypeVar

import msgspec
import numpy as np

from eidrive_scenario.driving.planning.behavior.lateral import LateralProfile
from eidrive_scenario.driving.planning.behavior.proposals import Proposal, Wall
from eidrive_scenario.driving.planning.behavior.rollout import Rollout
from eidrive_scenario.driving.planning.behavior.scoring import Evaluation

Record = TypeVar("Record", Rollout, Evaluation)


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

    def extend(self, other: Options) -> Options:
        """Return these options, and after them the others."""
        shift = len(self.profiles)
        moved = [msgspec.structs.replace(proposal, profile=proposal.profile + shift) for proposal in other.proposals]
        rolled = _concatenated(self.rolled, other.rolled)
        evaluation = _concatenated(self.evaluation, other.evaluation)
        proposals = self.proposals + moved
        return Options(self.profiles + other.profiles, proposals, self.walls + other.walls, rolled, evaluation)


def _concatenated(one: Record, other: Record) -> Record:
    """Return the record whose arrays are those of both."""
    pairs = zip(msgspec.structs.astuple(one), msgspec.structs.astuple(other), strict=True)
    return type(one)(*(np.concatenate(pair) for pair in pairs))
