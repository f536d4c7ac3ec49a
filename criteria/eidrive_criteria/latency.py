"""Criterion: delay of messages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import PHRASES, Measure, Sample
from eidrive_criteria.linked import Link, LinkCriterion, LinkSettings
from eidrive_scenario.api.criteria import Verdict
from eidrive_scenario.api.v2x import ReceivedMessage


class LatencySettings(LinkSettings):
    """Settings: `{receiver: Ego, measure: p95, at_most: 0.1}` [s]; without `at_most` it only measures and passes."""

    measure: Measure = "mean"
    at_most: Annotated[float, Field(ge=0)] | None = None


class Latency(LinkCriterion):
    """Criterion that fails if the time from the generation of the received messages to their arrival is too long.

    Messages that are lost or still in flight have no delay.
    """

    settings_type = LatencySettings
    name = "latency"
    unit = "s"

    def __init__(self, settings: LatencySettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self._delays = Sample(settings.measure, settings.at_most)

    def add_reception(self, link: Link, received: ReceivedMessage) -> None:
        self._delays.add([received.arrived - received.message.generated], self.time)

    def verdict(self) -> Verdict:
        value = self._delays.value
        if value is None:
            reason = self.nothing("received message")
        else:
            reason = f"messages {self.where} arrived after {value:.3f} s {PHRASES[self._settings.measure]}"
        return self._delays.conclude(self, reason, measured=not self.missing)

    def metrics(self) -> Mapping[str, float]:
        """Return all measures [s]; empty without a reception."""
        return {f"{self.name}.{measure}": value for measure, value in self._delays.values().items()}
