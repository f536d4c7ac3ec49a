"""Criterion: no contact between an actor and others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from pydantic import Field, model_validator

from eidrive_scenario.api.common import RoadNetwork, WorldView
from eidrive_scenario.api.criteria import (
    Criterion,
    CriterionSettings,
    Frame,
    Impact,
    LaneTracker,
    Verdict,
    actor_never_present,
    judge_impact,
)


class CollisionSettings(CriterionSettings):
    """Settings: `{of: Ego}` for contact with any body, `{of: Ego, with: Incoming}` or `{of: Ego, with: [A, B]}`.

    only_at_fault  whether contacts count only if the actor is at fault
    """

    of: str
    others: str | tuple[str, ...] | None = Field(default=None, alias="with")
    only_at_fault: bool = False

    @model_validator(mode="after")
    def _others_only(self) -> Self:
        if self.others == ():
            raise ValueError("'with' lists no actor (expected actors, or no 'with' for contact with any body)")
        if self.others is not None and self.of in ((self.others,) if isinstance(self.others, str) else self.others):
            raise ValueError(f"'with' contains the actor itself (got {self.of!r}; expected another actor)")
        return self


@dataclass(frozen=True)
class Hit:
    """Start of a contact at `time` [s] at `x`, `y` [m], with relative speed `speed` [m/s]."""

    time: float
    other: str
    x: float
    y: float
    speed: float
    impact: Impact | None


class Collision(Criterion):
    """Criterion that fails at the first contact.

    The reason states actors, time, position, speed, the side of `of` that was hit, and whether `of` is at fault. The
    value is the number of contacts.
    """

    settings_type = CollisionSettings
    name = "collision"

    def __init__(self, settings: CollisionSettings) -> None:
        super().__init__(settings)
        others = settings.others
        self._of = settings.of
        self._others = (others,) if isinstance(others, str) else others
        self.subjects = (self._of, *(self._others or ()))
        self._missing = set(self.subjects)
        self._only_at_fault = settings.only_at_fault
        self._hits: list[Hit] = []
        self._before: WorldView | None = None
        self._lanes: LaneTracker | None = None

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        self._lanes = LaneTracker(roads) if roads is not None else None

    def observe(self, frame: Frame) -> None:
        view = frame.view
        if self._missing:
            self._missing.difference_update(view.names)
        for contact in view.contacts:
            if self._of not in (contact.first, contact.second):
                continue
            other = contact.second if contact.first == self._of else contact.first
            if self._others is None or other in self._others:
                x, y, _ = contact.position
                impact = None
                if self._of in view.rows:  # A recording may lack it.
                    impact = judge_impact(view, self._before, self._of, other, x, y, self._lanes)
                if not self._only_at_fault or (impact is not None and impact.at_fault):
                    self._hits.append(Hit(view.time, other, x, y, contact.impact_speed, impact))
                    self.violated_with = self.violated_with or other
        self._before = view

    def verdict(self) -> Verdict:
        first = self._hits[0] if self._hits else None
        if first is not None:
            reason = (
                f"{self._of} and {first.other} hit each other at {first.time:.2f} s at "
                f"({first.x:.1f}, {first.y:.1f}) m at a relative speed of {first.speed:.1f} m/s"
            )
            if first.impact is not None:
                fault = "at fault" if first.impact.at_fault else "not at fault"
                reason += f"; {self._of} with its {first.impact.side}, {fault} as {first.impact.rule}"
        elif self._missing:
            reason = actor_never_present(self._missing)
        else:
            touched = f"did not touch {' or '.join(self._others)}" if self._others else "touched nothing"
            reason = f"{self._of} {touched}" + (" by its own fault" if self._only_at_fault else "")
        return self.conclude(
            first is None and not self._missing,
            reason,
            value=float(len(self._hits)),
            limit=0.0,
            first_violation=first.time if first is not None else None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the numbers of contacts and of those by own fault, and time [s] and speed [m/s] of the first one."""
        metrics = {f"{self.name}.count": float(len(self._hits))}
        if self._hits:
            metrics[f"{self.name}.time"] = self._hits[0].time
            metrics[f"{self.name}.impact_speed"] = self._hits[0].speed
            metrics[f"{self.name}.at_fault"] = float(
                sum(hit.impact is not None and hit.impact.at_fault for hit in self._hits)
            )
        return metrics
