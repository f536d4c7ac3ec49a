"""Criterion: delay of messages."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from eidrive_criteria.linked import Link, LinkCriterion, LinkSettings
from eidrive_scenario.api.criteria import Verdict
from eidrive_scenario.api.v2x import ReceivedMessage

Measure = Literal["mean", "p95", "max"]
PHRASES: Mapping[Measure, str] = {"mean": "on average", "p95": "at the 95th percentile", "max": "at most"}


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
        self._delays = array("d")
        self._violated: float | None = None

    def add_reception(self, link: Link, received: ReceivedMessage) -> None:
        settings, delay = self._settings, received.arrived - received.message.generated
        self._delays.append(delay)
        if settings.measure == "max" and self._violated is None and settings.at_most is not None:
            self._violated = self.time if delay > settings.at_most else None

    def _values(self) -> dict[Measure, float]:
        """Return the value of each measure; empty without a reception."""
        if not self._delays:
            return {}
        delays = np.array(self._delays)
        return {
            "mean": float(delays.mean()),
            "p95": float(np.percentile(delays, 95)),
            "max": float(delays.max()),
        }

    def verdict(self) -> Verdict:
        settings, value = self._settings, self._values().get(self._settings.measure)
        if value is None:
            reason = self.nothing("received message")
        else:
            reason = f"messages {self.where} arrived after {value:.3f} s {PHRASES[settings.measure]}"
        exceeds = value is not None and settings.at_most is not None and value > settings.at_most
        return self.conclude(
            not self.missing and not exceeds,
            reason,
            value=value,
            limit=settings.at_most,
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return all measures [s]; empty without a reception."""
        return {f"{self.name}.{measure}": value for measure, value in self._values().items()}
