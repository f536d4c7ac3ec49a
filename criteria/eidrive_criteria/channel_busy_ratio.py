"""Criterion: share of time in which stations measure a busy channel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import exceeds
from eidrive_scenario.api.criteria import (
    Criterion,
    CriterionSettings,
    Frame,
    LinkStatistics,
    Verdict,
    actor_never_present,
)


class ChannelBusyRatioSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 0.6}`; without `of` the largest value of all stations counts."""

    of: str | None = None
    at_most: Annotated[float, Field(ge=0, le=1)] | None = None


class ChannelBusyRatio(Criterion):
    """Criterion that fails if the channel busy ratio that a station measures over the run exceeds `at_most`.

    The statistics of the links contain it, so that it is known after the run only.
    """

    settings_type = ChannelBusyRatioSettings
    name = "channel_busy_ratio"

    def __init__(self, settings: ChannelBusyRatioSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = () if settings.of is None else (settings.of,)
        self._was_present = settings.of is None
        self._ratios: dict[str, float] = {}

    def observe(self, frame: Frame) -> None:
        self._was_present = self._was_present or self._settings.of in frame.view.rows

    def observe_links(self, links: Mapping[tuple[str, str], LinkStatistics]) -> None:
        of = self._settings.of
        for (_, receiver), statistics in links.items():
            if of in (None, receiver) and statistics.channel_busy_ratio is not None:
                self._ratios[receiver] = statistics.channel_busy_ratio

    def _largest(self) -> tuple[str, float] | None:
        return max(self._ratios.items(), key=lambda item: item[1]) if self._ratios else None

    def verdict(self) -> Verdict:
        limit, largest = self._settings.at_most, self._largest()
        value = None if largest is None else largest[1]
        if not self._was_present:
            reason = actor_never_present([str(self._settings.of)])
        elif largest is None:
            reason = "no channel with a busy ratio was used"
        else:
            reason = f"{largest[0]} measured a busy channel for {100 * largest[1]:.1f} % of the time"
        is_busy = value is not None and exceeds(value, limit)
        return self.conclude(self._was_present and not is_busy, reason, value=value, limit=limit)

    def metrics(self) -> Mapping[str, float]:
        """Return the ratio of each station that measures one."""
        return {f"{self.name}.{station}": ratio for station, ratio in self._ratios.items()}
