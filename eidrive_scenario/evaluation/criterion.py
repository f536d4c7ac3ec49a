"""A criterion passes or fails a run: a fold over frames, the same code live and over a recording."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.settings import Settings


@dataclass(frozen=True)
class Verdict:
    """What a criterion found. `value` and `limit` are in `unit`; `first_violation` is a time [s]."""

    name: str
    passed: bool
    value: float | None
    limit: float | None
    unit: str
    first_violation: float | None
    reason: str
    fatal: bool = False
    """True where the failure shall end the run: it is final, and not that something has yet to appear or happen."""


class CriterionSettings(Settings):
    """What every criterion may be told; a criterion's own settings add to it."""

    name: Annotated[str, Field(min_length=1)] | None = None
    """What the verdict is called; the criterion's registered name where None."""
    fatal: bool = False
    """End the run as soon as this criterion has failed for good."""


class Criterion(ABC):
    """Observes every frame of a run once, in order, then answers.

    A class is registered in the entry points `eidrive_scenario.criteria` and built as `cls(settings)`, with `settings`
    an instance of its `settings_type`. An actor that it looks at and that never appeared is a failed verdict with the
    reason `actor_never_present`, never a pass.
    """

    settings_type: ClassVar[type[CriterionSettings]] = CriterionSettings
    name: str
    fatal: bool = False
    subjects: tuple[str, ...] = ()
    """The actors that it cannot do without; whoever knows the scenario's entities checks them before the run."""
    monitors: tuple[str, ...] = ()
    """The MonitorDeclarations that it reads, checked in the same way."""

    def __init__(self, settings: CriterionSettings) -> None:
        if settings.name is not None:
            self.name = settings.name
        self.fatal = settings.fatal

    @abstractmethod
    def observe(self, frame: Frame) -> None:
        """Take one frame into account."""

    @abstractmethod
    def verdict(self) -> Verdict:
        """The verdict over all frames so far; may be asked at any time."""

    def metrics(self) -> Mapping[str, float]:
        """Numbers worth keeping beside the verdict, by a name that starts with the criterion's."""
        return {}


def actor_never_present(names: Iterable[str]) -> str:
    """The reason of a verdict about actors that were never in the world."""
    names = sorted(names)
    verb = "was" if len(names) == 1 else "were"
    return f"{' and '.join(names)} {verb} never in the world, so nothing was measured"


def checked_verdict(criterion: Criterion) -> Verdict:
    """Return the verdict of a criterion. Raise InvalidResult if it is none, or if its numbers are undefined."""
    verdict: object = criterion.verdict()
    if not isinstance(verdict, Verdict):
        what = "None" if verdict is None else f"an object of type {type(verdict).__name__}"
        raise InvalidResult(criterion, "verdict", f"returned {what} (expected Verdict)")
    if not isinstance(verdict.passed, bool | np.bool_):
        raise InvalidResult(criterion, "verdict", f"returned passed = {verdict.passed!r} (expected True or False)")
    for name in ("value", "limit", "first_violation"):
        number = getattr(verdict, name)
        if number is not None and (not isinstance(number, Real | np.bool_) or number != number):
            raise InvalidResult(criterion, "verdict", f"returned {name} = {number!r} (expected a number or None)")
    for name in ("name", "unit", "reason"):
        if not isinstance(text := getattr(verdict, name), str):
            raise InvalidResult(criterion, "verdict", f"returned {name} = {text!r} (expected a text)")
    return verdict


def checked_metrics(criterion: Criterion) -> Mapping[str, float]:
    """Return the metrics of a criterion. Raise InvalidResult if they are no numbers by name."""
    metrics: object = criterion.metrics()
    if not isinstance(metrics, Mapping):
        raise InvalidResult(criterion, "metrics", f"returned {metrics!r} (expected numbers by name)")
    for name, number in metrics.items():
        if not isinstance(name, str) or not isinstance(number, Real | np.bool_):
            raise InvalidResult(criterion, "metrics", f"returned {name!r}: {number!r} (expected numbers by name)")
    return metrics


def evaluate_criteria(frames: Iterable[Frame], criteria: Sequence[Criterion]) -> tuple[Verdict, ...]:
    """The verdicts of `criteria` over `frames`, say of a recording."""
    for frame in frames:
        for criterion in criteria:
            criterion.observe(frame)
    return tuple(checked_verdict(criterion) for criterion in criteria)
