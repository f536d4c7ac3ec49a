"""Criterion: distances of Responsibility-Sensitive Safety (RSS)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from eidrive_criteria.folds import exceeds, falls_below
from eidrive_criteria.pairs import LeaderSettings, SurroundedCriterion
from eidrive_scenario.api.criteria import Frame, Relation, SafeDistanceModel, Verdict, actor_never_present

STANDING = 0.1
"""Maximum speed of a standing actor [m/s]."""

Positive = Annotated[float, Field(gt=0)]


class RssViolationSettings(LeaderSettings):
    """Settings: `{of: Ego, to: Lead}`, or `{of: Ego}` for all actors; parameters of the model with CARLA's defaults.

    reaction_time [s]; max_acceleration, min_braking, max_braking, min_braking_correct [m/s²];
    lateral_acceleration, lateral_braking [m/s²]; lateral_margin [m]
    share  share of the time in which the distances may be too small, 0 to 1
    """

    share: Annotated[float, Field(ge=0, le=1)] = 0.0
    reaction_time: Annotated[float, Field(ge=0)] = 1.0
    max_acceleration: Annotated[float, Field(ge=0)] = 3.5
    min_braking: Positive = 4.0
    max_braking: Positive = 8.0
    min_braking_correct: Positive = 3.0
    lateral_acceleration: Annotated[float, Field(ge=0)] = 0.2
    lateral_braking: Positive = 0.8
    lateral_margin: Annotated[float, Field(ge=0)] = 0.1

    @model_validator(mode="after")
    def _braking(self) -> Self:
        if self.max_braking < self.min_braking:
            raise ValueError(f"'max_braking' is less than 'min_braking' (got {self.max_braking} < {self.min_braking})")
        return self

    def model(self) -> SafeDistanceModel:
        """Return the model of the minimum distances."""
        return SafeDistanceModel(**self.model_dump(include=set(SafeDistanceModel.__dataclass_fields__)))


class RssViolation(SurroundedCriterion):
    """Criterion that fails if the longitudinal and the lateral distance to an actor are both below those of RSS.

    Excluded are actors behind, which have to keep the distance themselves, actors that cross the lane, for which RSS
    has other rules, and the time in which the actor itself stands. The value is the share of the time with a violation;
    a single violation fails the criterion unless `share` allows it.
    """

    settings_type = RssViolationSettings
    name = "rss_violation"

    def __init__(self, settings: RssViolationSettings) -> None:
        super().__init__(settings, settings.of, settings.to)
        self._share, self._model = settings.share, settings.model()
        self._ticks = self._violations = 0
        self._ratio, self._when, self._other = math.inf, math.nan, ""
        self._first: float | None = None

    def observe(self, frame: Frame) -> None:
        view = frame.view
        if self.missing:
            self.missing.difference_update(view.names)
        own = view.rows.get(self.of)
        if own is None:
            return
        self._ticks += 1
        violated = False
        speeds = np.hypot(view.velocity[:, 0], view.velocity[:, 1])
        reach = self._model.longest(float(speeds[own]), float(speeds.max()))
        for relation in self.surroundings.relations(view, self.of, self.others, reach):
            # A body that overlaps from behind is a coupled trailer, or has hit this one.
            behind = relation.ahead < 0.0 and (relation.gap > 0.0 or relation.side_gap == 0.0)
            stands = falls_below(math.hypot(relation.speed, relation.side_speed), STANDING)
            if behind or relation.crosses or stands:
                continue
            ratio = safety_ratio(self._model, relation)
            if ratio < self._ratio:
                self._ratio, self._when, self._other = ratio, view.time, relation.other
            if ratio < 1.0:
                violated, self.violated_with = True, self.violated_with or relation.other
        if violated:
            self._violations += 1
            self._first = view.time if self._first is None else self._first

    def verdict(self) -> Verdict:
        of, share = self.of, self._violations / self._ticks if self._ticks else None
        passed = not self.missing and share is not None and not exceeds(share, self._share)
        if self.missing:
            reason = actor_never_present(self.missing)
        elif math.isfinite(self._ratio):
            reason = (
                f"{of} had {self._ratio:.2f} of the required distance to {self._other} at {self._when:.2f} s; the "
                f"distance was too small in {share or 0.0:.1%} of the time"
            )
        else:
            reason = f"{of} needed no distance from any actor"
        return self.conclude(
            passed,
            reason,
            value=share,
            limit=self._share,
            first_violation=self._first if not passed else None,
            is_final=self._first is not None and self._share == 0.0,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the share of the time with a violation, and the smallest ratio of distance to required distance."""
        share = {f"{self.name}.share": self._violations / self._ticks} if self._ticks else {}
        return share | ({f"{self.name}.ratio": self._ratio} if math.isfinite(self._ratio) else {})


def safety_ratio(model: SafeDistanceModel, relation: Relation) -> float:
    """Return the larger ratio of distance to minimum distance, longitudinal and lateral; below 1 is dangerous.

    It is infinite if a minimum distance is 0 at a distance above it.
    """
    own, other = max(relation.speed, 0.0), abs(relation.other_speed)
    if relation.other_speed >= 0.0:
        required = model.same_direction(own, other) if relation.gap > 0.0 else math.inf
    else:
        required = model.opposite(other, own) if relation.wrong_way else model.opposite(own, other)
    if relation.left >= 0.0:
        beside = model.lateral(-relation.other_side_speed, -relation.side_speed)
    else:
        beside = model.lateral(-relation.side_speed, -relation.other_side_speed)
    return max(_ratio(relation.gap, required), _ratio(relation.side_gap, beside))


def _ratio(distance: float, required: float) -> float:
    return distance / required if required > 0.0 else math.inf
