"""Criterion: share of the true objects that a station detects."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_criteria.perceived import GROUPS, PerceivedSettings, RecalledCriterion, RecalledSettings
from eidrive_scenario.api.criteria import Verdict


class DetectionRecallSettings(RecalledSettings, PerceivedSettings):
    """Settings: `{of: Ego, objects: helper_only, range: 50, at_least: 0.8}`; limits are shares from 0 to 1."""


class DetectionRecall(RecalledCriterion):
    """Criterion that fails if the share of the true objects in range that the station knows is outside the limits."""

    settings_type = DetectionRecallSettings
    name = "detection_recall"

    def __init__(self, settings: DetectionRecallSettings) -> None:
        super().__init__(settings)
        self._settings = settings

    def verdict(self) -> Verdict:
        settings = self._settings
        value = self.recall(settings.source, settings.objects)
        if not self.perceives:
            reason = self.no_perception()
        elif value is None:
            reason = self.no_objects()
        else:
            of = f"{GROUPS[settings.objects]} within {settings.range:g} m"
            reason = f"{self.of} knew {100 * value:.1f} % of {of} ({settings.source} objects)"
        return self.conclude(
            self.perceives and (value is None or settings.allows(value)),
            reason,
            value=value,
            limit=settings.limit_of(value),
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the recall of each group that had objects."""
        recalls = {group: self.recall(self._settings.source, group) for group in GROUPS}
        return {f"{self.name}.{self.of}.{group}": value for group, value in recalls.items() if value is not None}
