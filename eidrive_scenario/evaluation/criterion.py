"""Base class of criteria, which pass or fail a run. The same code evaluates live frames and recorded frames."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.errors import Diagnostic, EidriveError, InvalidResult, SettingError, quoted
from eidrive_scenario.evaluation.violation_state import LOOKBACK, describe_violation
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import Settings, settings_type_of
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics


@dataclass(frozen=True)
class Verdict:
    """Result of a criterion. `value` and `limit` are in `unit`; `first_violation` is a time [s]."""

    name: str
    passed: bool
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    first_violation: float | None = None
    reason: str = ""
    fatal: bool = False
    """True if the failure ends the run. The failure must be final: no later event can fulfill the criterion."""
    violation_state: tuple[str, ...] = field(default=(), compare=False)
    """State of the stations at the first violation, as lines of text that begin with its time. A `CriteriaObserver`
    sets it; empty if the criterion passed."""


class CriterionSettings(Settings):
    """Settings of every criterion. A criterion extends them with its own settings."""

    name: Annotated[str, Field(min_length=1)] | None = None
    """Name of the verdict; None for the registered name of the criterion."""
    fatal: bool = False
    """Whether a final failure of this criterion ends the run."""


class Criterion(ABC):
    """Observer of every frame of a run, in order and once each, that returns a verdict.

    A class is registered in the entry points `eidrive_scenario.criteria` and built as `cls(settings)`, with `settings`
    an instance of its `settings_type`. If an evaluated actor was never present, the verdict is failed, with the reason
    `actor_never_present`.
    """

    settings_type: ClassVar[type[CriterionSettings]] = CriterionSettings
    unit: ClassVar[str] = ""
    """Unit of the value and the limit; empty for counts and shares."""
    name: str
    fatal: bool = False
    subjects: tuple[str, ...] = ()
    """Names of the required actors, checked against the entities of the scenario before the run."""
    violated_with: str = ""
    """Other actor of the first violation, if `subjects` does not contain it; empty if there is none."""
    monitors: tuple[str, ...] = ()
    """Names of the evaluated MonitorDeclarations, checked before the run."""
    demands_progress: bool = False
    """Whether it fails an actor that never drives on. A class or an instance sets it, by its settings."""
    needs_roads: ClassVar[bool] = False
    """Whether the criterion requires roads; a scenario without roads is then an error before the run."""
    needs_route: bool = False
    """Whether it evaluates the route that the scenario requests; a scenario that requests none is then an error before
    the run."""
    roads: RoadNetwork | None = None
    """Roads of the scenario, None without roads. Set by `bind` before the first frame."""

    def __init__(self, settings: CriterionSettings) -> None:
        if settings.name is not None:
            self.name = settings.name
        self.fatal = settings.fatal

    def bind(self, roads: RoadNetwork | None) -> None:
        """Set the roads of the scenario, once before the first frame."""
        self.roads = roads

    @property
    def error_subject(self) -> str:
        """Verdict that errors of the criterion name; "" if it has the name of the class."""
        return "" if self.name == getattr(type(self), "name", None) else f"verdict {self.name!r}"

    @abstractmethod
    def observe(self, frame: Frame) -> None:
        """Process one frame."""

    def observe_final_links(self, events: Sequence[LinkEvent]) -> None:  # noqa: B027 - optional
        """Process the message outcomes that became known in the last tick, once after the last frame of a run.

        Those before are in `Frame.links`.
        """

    def observe_links(self, links: Mapping[tuple[str, str], LinkStatistics]) -> None:  # noqa: B027 - optional
        """Process the statistics of all links by (sender, receiver), once after the last frame of a run.

        They are not part of recordings.
        """

    @abstractmethod
    def verdict(self) -> Verdict:
        """Return the verdict over all frames so far. It may be called at any time."""

    def metrics(self) -> Mapping[str, float]:
        """Return additional numbers, by names that start with the name of the criterion."""
        return {}

    def conclude(
        self,
        passed: bool,
        reason: str,
        *,
        value: float | None = None,
        limit: float | None = None,
        first_violation: float | None = None,
        is_final: bool | None = None,
    ) -> Verdict:
        """Return a verdict with the name and the unit of the criterion.

        is_final  whether the failure is final, so that it ends the run if the criterion is fatal; None: it is if there
                  is a violation
        """
        final = first_violation is not None if is_final is None else is_final
        return Verdict(
            self.name, passed, value, limit, self.unit, first_violation, reason, self.fatal and final and not passed
        )


def bind_roads(criterion: Criterion, roads: RoadNetwork | None) -> None:
    """Bind a criterion to the roads of its scenario. Raise SettingError if it requires roads and there are none."""
    if roads is None and criterion.needs_roads:
        message = f"criterion {criterion.name!r} requires roads, and there are none"
        raise SettingError(Diagnostic(message, "pass the road network of the scenario"))
    criterion.bind(roads)


def actor_never_present(names: Iterable[str]) -> str:
    """Return the reason of a verdict about actors that were never present."""
    names = sorted(names)
    verb = "was" if len(names) == 1 else "were"
    return f"{' and '.join(names)} {verb} never present, so nothing was measured"


def checked_verdict(criterion: Criterion) -> Verdict:
    """Return the verdict of a criterion, with numbers and truth values of Python instead of those of numpy.

    Raise InvalidResult if it is not a Verdict, or if its numbers are undefined or exceed the range of a float.
    """
    verdict: object = criterion.verdict()
    if not isinstance(verdict, Verdict):
        what = "None" if verdict is None else f"an object of type {type(verdict).__name__}"
        raise InvalidResult(criterion, "verdict", f"returned {what} (expected Verdict)")
    if not isinstance(verdict.passed, bool | np.bool_):
        raise InvalidResult(criterion, "verdict", f"returned passed = {verdict.passed!r} (expected True or False)")
    plain: dict[str, Any] = {"passed": bool(verdict.passed), "fatal": bool(verdict.fatal)}
    for name in ("value", "limit", "first_violation"):
        number = getattr(verdict, name)
        plain[name] = None if number is None else _plain_number(number)
        if number is not None and (plain[name] is None or number != number):
            text = f"returned {name} = {quoted(number)} (expected a number or None)"
            raise InvalidResult(criterion, "verdict", text)
    for name in ("name", "unit", "reason"):
        if not isinstance(text := getattr(verdict, name), str):
            raise InvalidResult(criterion, "verdict", f"returned {name} = {text!r} (expected a text)")
    # Two criteria of one class have different names, also if the class returns a constant one.
    return replace(verdict, **plain, name=criterion.name)


def checked_metrics(criterion: Criterion) -> Mapping[str, float]:
    """Return the metrics of a criterion as numbers of Python. Raise InvalidResult if they are not numbers by name."""
    metrics: object = criterion.metrics()
    if not isinstance(metrics, Mapping):
        raise InvalidResult(criterion, "metrics", f"returned {metrics!r} (expected numbers by name)")
    plain: dict[str, float] = {}
    for name, number in metrics.items():
        value = _plain_number(number)
        if not isinstance(name, str) or value is None:
            text = f"returned {name!r}: {quoted(number)} (expected numbers by name)"
            raise InvalidResult(criterion, "metrics", text)
        plain[name] = value
    return plain


def _plain_number(number: object) -> float | None:
    """Return a number as float, or as int if it is one; None for another object, and beyond the range of a float."""
    if not isinstance(number, int | Real | np.bool_):
        return None
    try:
        as_float = float(number)
    except OverflowError:
        return None
    return number if isinstance(number, int) and not isinstance(number, bool) else as_float


class CriteriaObserver:
    """Passes the frames of one run to its criteria, and describes the state at the first violation of each.

    A criterion is asked for its verdict once per PERIOD only, so that a tick without a violation costs nothing. Frames
    are held until its answer is known: those of PERIOD, and those before them that `describe_violation` needs.

    criteria  of the run; the caller may append to the list between frames
    """

    PERIOD = 1.0
    """Simulated time between two searches for violations [s]."""

    def __init__(self, criteria: Sequence[Criterion]) -> None:
        self._criteria = criteria
        self._frames: deque[Frame] = deque()
        self._due = 0.0
        self._states: dict[int, tuple[float, tuple[str, ...]]] = {}
        """Time and description of the first violation, as of the last verdict, by the id of the criterion."""

    def observe(self, frame: Frame) -> None:
        """Process one frame."""
        for criterion in self._criteria:
            criterion.observe(frame)
        self._frames.append(frame)
        time = frame.view.time
        if time >= self._due:
            self._due = time + self.PERIOD
            self._search()
            while self._frames[0].view.time < time - self.PERIOD - LOOKBACK:
                self._frames.popleft()

    def _search(self) -> None:
        """Describe the violations since the last search."""
        for criterion in self._criteria:
            with suppress(Exception):  # The verdict counts at the end of the run, which reports its errors
                violation = criterion.verdict().first_violation
                if violation is not None:
                    self._describe(criterion, float(violation))

    def _describe(self, criterion: Criterion, violation: float) -> tuple[str, ...] | None:
        """Return the state at a violation at a time [s]; None if its frame is not held any more."""
        key = id(criterion)
        if key in self._states and self._states[key][0] == violation:
            return self._states[key][1]
        frames = list(self._frames)
        count = sum(frame.view.time < violation - TIME_TOLERANCE for frame in frames) + 1
        is_held = count > 1 or abs(frames[0].view.time - violation) <= TIME_TOLERANCE
        if not is_held or count > len(frames):
            return None
        state = f"first violation at {violation:.2f} s", *describe_violation(frames[:count], _actors(criterion))
        self._states[key] = violation, state
        return state

    def verdicts(self, exit_verdict: Verdict | None = None) -> tuple[Verdict, ...]:
        """Return the verdicts of all criteria over all frames, and of a command that has ended the run.

        A failure without a first violation is judged at the last frame, which its state describes.
        """
        verdicts = [self._with_state(criterion, checked_verdict(criterion)) for criterion in self._criteria]
        return tuple(verdicts if exit_verdict is None else [*verdicts, self._with_state(None, exit_verdict)])

    def _with_state(self, criterion: Criterion | None, verdict: Verdict) -> Verdict:
        if verdict.passed or not self._frames:
            return verdict
        violation = verdict.first_violation
        if criterion is not None and violation is not None and (state := self._describe(criterion, violation)):
            return replace(verdict, violation_state=state)
        frames = list(self._frames)
        end = f"state at the last tick, {frames[-1].view.time:.2f} s"
        title = end if violation is None else f"first violation at {violation:.2f} s; {end}"
        actors = () if criterion is None else _actors(criterion)
        return replace(verdict, violation_state=(title, *describe_violation(frames, actors)))


def _actors(criterion: Criterion) -> tuple[str, ...]:
    """Return the actors that the first violation of a criterion concerns."""
    return tuple(dict.fromkeys(name for name in (*criterion.subjects, criterion.violated_with) if name))


def evaluate_criteria(
    frames: Iterable[Frame],
    criteria: Sequence[Criterion],
    roads: RoadNetwork | None = None,
    links: Mapping[tuple[str, str], LinkStatistics] | None = None,
    final_links: Sequence[LinkEvent] = (),
) -> tuple[Verdict, ...]:
    """Return the verdicts of `criteria` over `frames`, for example of a recording.

    roads  of the scenario. Raise SettingError if they are missing and a criterion requires them.
    links  statistics of the links of the run, as `RunResult.links`
    final_links  message outcomes that became known in the last tick, as `RunResult.final_links`
    """
    for criterion in criteria:
        bind_roads(criterion, roads)
    observer = CriteriaObserver(criteria)
    for frame in frames:
        observer.observe(frame)
    for criterion in criteria:
        criterion.observe_final_links(final_links)
    for criterion in criteria if links is not None else ():
        criterion.observe_links(links or {})
    return observer.verdicts()


def describe_criteria() -> Iterator[tuple[str, str, str, str]]:
    """Yield name, unit, settings with defaults and definition of each criterion.

    The definition of a criterion that does not load is its class and its error.
    """
    criteria = registry("criteria")
    for name in criteria:
        try:
            criterion_type: type[Criterion] = criteria.load(name, Criterion)
            settings_type = settings_type_of("criteria", name, criterion_type, CriterionSettings)
            yield name, criterion_type.unit or "-", _settings(settings_type), _definition(criterion_type)
        except EidriveError as error:
            yield name, "-", "", f"{criteria.value(name)}: {str(error).splitlines()[0]}"


def _settings(model: type[CriterionSettings]) -> str:
    """Return the own settings of a criterion; optional ones without a default value have a question mark."""
    shared = CriterionSettings.model_fields
    fields = [(field.alias or name, field) for name, field in model.model_fields.items() if name not in shared]
    return "{" + ", ".join(name + _default(field) for name, field in fields) + "}"


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return ""
    return "?" if field.default is None else f": {str(field.default).lower()}"


def _definition(criterion_type: type[Criterion]) -> str:
    """Return the first sentence of the documentation of a class."""
    text = " ".join((inspect.getdoc(criterion_type) or "").split("\n\n")[0].split())
    return text.removeprefix("Criterion that ").split(". ")[0].rstrip(".")
