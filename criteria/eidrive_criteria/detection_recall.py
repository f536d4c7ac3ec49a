"""Criterion: share of the true objects that a station detects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.folds import share_margin
from eidrive_criteria.perceived import Group, PerceivedSettings, RecalledCriterion, RecalledSettings


class DetectionRecallSettings(RecalledSettings, PerceivedSettings):
    """Settings: `{of: Ego, objects: helper_only, range: 50, at_least: 0.8}`; limits are shares from 0 to 1."""

    at_least: Annotated[float, Field(ge=0, le=1)] | None = None
    at_most: Annotated[float, Field(ge=0, le=1)] | None = None


class DetectionRecall(RecalledCriterion):
    """Criterion that fails if the share of the true objects in range that the station knows is outside the limits."""

    settings_type = DetectionRecallSettings
    name = "detection_recall"

    def __init__(self, settings: DetectionRecallSettings) -> None:
        super().__init__(settings)
        self._settings = settings

    def value_of(self, group: Group) -> float | None:
        return self.recall(self._settings.source, group)

    def metrics(self) -> Mapping[str, float]:
        """Return the recall of each group that had objects, and the margin to a lower limit that is nearer."""
        settings, value = self._settings, self.value_of(self._settings.objects)
        if value is None or settings.limit_of(value) != settings.at_least:
            return super().metrics()
        return {**super().metrics(), **share_margin(self.name, value, settings.at_least)}

    def describe(self, objects: str) -> str:
        share = self.value_of(self._settings.objects) or 0.0
        return f"{self.of} knew {100 * share:.1f} % of {objects} ({self._settings.source} objects)"
