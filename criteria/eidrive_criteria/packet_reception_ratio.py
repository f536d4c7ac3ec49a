"""Criterion: share of the messages that are received."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import falls_below, share_margin
from eidrive_criteria.linked import LinkCriterion, LinkSettings
from eidrive_scenario.api.common import counted
from eidrive_scenario.api.criteria import Verdict
from eidrive_scenario.api.v2x import LinkEvent


class PacketReceptionRatioSettings(LinkSettings):
    """Settings: `{sender: RSU, receiver: Ego, at_least: 0.9}`; without `at_least` it only measures and passes."""

    at_least: Annotated[float, Field(ge=0, le=1)] | None = None


class PacketReceptionRatio(LinkCriterion):
    """Criterion that fails if the share of the messages on the links that are delivered is below `at_least`.

    A message counts once per receiver, when its outcome is known. Lost messages of all reasons count.
    """

    settings_type = PacketReceptionRatioSettings
    name = "packet_reception_ratio"

    def __init__(self, settings: PacketReceptionRatioSettings) -> None:
        super().__init__(settings)
        self._limit = settings.at_least
        self._delivered = self._number = 0

    def add_outcome(self, event: LinkEvent) -> None:
        self._number += 1
        self._delivered += event.outcome == "delivered"

    def _ratio(self) -> float | None:
        return self._delivered / self._number if self._number else None

    def verdict(self) -> Verdict:
        value = self._ratio()
        reason = f"{self._delivered} of {counted(self._number, 'message')} {self.where} were delivered"
        return self.conclude(
            not self.missing and (value is None or not falls_below(value, self._limit)),
            self.nothing("message") if value is None else reason,
            value=value,
            limit=self._limit,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the ratio, and its margin with a limit; empty without messages."""
        value = self._ratio()
        return {} if value is None else {self.name: value, **share_margin(self.name, value, self._limit)}
