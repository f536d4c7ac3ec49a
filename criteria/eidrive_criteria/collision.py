"""Criterion: no contact between an actor and others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from pydantic import Field, model_validator

from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present


class CollisionSettings(CriterionSettings):
    """Settings: `{of: Ego}` for contact with any body, `{of: Ego, with: Incoming}` or `{of: Ego, with: [A, B]}`."""

    of: str
    others: str | tuple[str, ...] | None = Field(default=None, alias="with")

    @model_validator(mode="after")
    def _not_itself(self) -> Self:
        if self.others is not None and self.of in ((self.others,) if isinstance(self.others, str) else self.others):
            raise ValueError(f"'with' contains the actor itself (got {self.of!r}; expected another actor)")
        return self


@dataclass(frozen=True)
class Impact:
    """Start of a contact at `time` [s] at `x`, `y` [m], with closing speed `speed` [m/s]."""

    time: float
    other: str
    x: float
    y: float
    speed: float


class Collision(Criterion):
    """Criterion that fails at the first contact.

    The reason states actors, time, position and speed. The value is the number of contacts.
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
        self._impacts: list[Impact] = []

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
                self._impacts.append(Impact(view.time, other, x, y, contact.impact_speed))

    def verdict(self) -> Verdict:
        first = self._impacts[0] if self._impacts else None
        if first is not None:
            reason = (
                f"{self._of} and {first.other} hit each other at {first.time:.2f} s at "
                f"({first.x:.1f}, {first.y:.1f}) m at a relative speed of {first.speed:.1f} m/s"
            )
        elif self._missing:
            reason = actor_never_present(self._missing)
        else:
            touched = f"did not touch {' or '.join(self._others)}" if self._others else "touched nothing"
            reason = f"{self._of} {touched}"
        return Verdict(
            name=self.name,
            passed=first is None and not self._missing,
            value=float(len(self._impacts)),
            limit=0.0,
            unit="",
            first_violation=first.time if first is not None else None,
            reason=reason,
            fatal=self.fatal and first is not None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the number of contacts, and time [s] and relative speed [m/s] of the first one."""
        found = {f"{self.name}.count": float(len(self._impacts))}
        if self._impacts:
            found[f"{self.name}.time"] = self._impacts[0].time
            found[f"{self.name}.impact_speed"] = self._impacts[0].speed
        return found
