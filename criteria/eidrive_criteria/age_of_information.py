"""Criterion: age of the newest received message."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from eidrive_criteria.folds import exceeds
from eidrive_criteria.linked import Link, LinkCriterion, LinkSettings
from eidrive_scenario.api.criteria import Frame, ReceptionLog, Verdict
from eidrive_scenario.api.v2x import LinkEvent, ReceivedMessage

Measure = Literal["mean", "p95", "peak"]
PHRASES: Mapping[Measure, str] = {
    "mean": "on average",
    "p95": "at the 95th percentile",
    "peak": "on average before an update",
}


class AgeOfInformationSettings(LinkSettings):
    """Settings: `{receiver: Ego, measure: peak, at_most: 0.5}` [s]; without `at_most` it only measures and passes."""

    measure: Measure = "mean"
    at_most: Annotated[float, Field(ge=0)] | None = None


class AgeOfInformation(LinkCriterion):
    """Criterion that fails if the age of information of one of the links exceeds `at_most`.

    The age is the time since the generation of the newest message that the receiver has got from the sender. It counts
    from the first reception on, and again after an absence of the receiver. A link on which all messages were lost has
    an infinite age.
    """

    settings_type = AgeOfInformationSettings
    name = "age_of_information"
    unit = "s"

    def __init__(self, settings: AgeOfInformationSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self._log = ReceptionLog()
        self._used: set[Link] = set()
        """Links with a lost or received message."""

    def observe(self, frame: Frame) -> None:
        for receiver in {receiver for _, receiver in self._used if receiver not in frame.view.rows}:
            self._log.end_links(receiver, self.time)
        super().observe(frame)

    def add_outcome(self, event: LinkEvent) -> None:
        if event.outcome == "lost":
            self._used.add((event.sender, event.receiver))

    def add_reception(self, link: Link, received: ReceivedMessage) -> None:
        message = received.message
        self._used.add(link)
        self._log.record(link[1], [(received.arrived, link[0], message.number, message.generated, received)])

    def _ages(self) -> dict[Measure, tuple[float, Link]]:
        """Return the largest age of each measure with its link; without the undefined ones."""
        statistics = self._log.statistics_by_link(self.time)
        ages: dict[Measure, tuple[float, Link]] = {}
        for link in sorted(self._used):
            of_link = statistics.get(link)
            values: dict[Measure, float | None] = dict.fromkeys(PHRASES, math.inf)
            if of_link is not None:
                values = {"mean": of_link.mean_age, "p95": of_link.p95_age, "peak": of_link.peak_age}
            for measure, value in values.items():
                if value is not None and (measure not in ages or value > ages[measure][0]):
                    ages[measure] = value, link
        return ages

    def verdict(self) -> Verdict:
        settings, oldest = self._settings, self._ages().get(self._settings.measure)
        value = None if oldest is None else oldest[0]
        if oldest is None:
            reason = self.nothing("received message")
        elif math.isinf(oldest[0]):
            reason = f"no message from {oldest[1][0]} to {oldest[1][1]} was received"
        else:
            newest = f"the newest message from {oldest[1][0]} to {oldest[1][1]} was {value:.3f} s old"
            reason = f"{newest} {PHRASES[settings.measure]}"
        passed = not self.missing and not (value is not None and exceeds(value, settings.at_most))
        return self.conclude(passed, reason, value=value, limit=settings.at_most)

    def metrics(self) -> Mapping[str, float]:
        """Return the largest age of each measure [s]; empty without a message."""
        return {f"{self.name}.{measure}": value for measure, (value, _) in self._ages().items()}
