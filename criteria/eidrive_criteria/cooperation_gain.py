"""Criterion: gain in recall by cooperation, within one run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from eidrive_criteria.perceived import GROUPS, Group, RecalledCriterion, RecalledSettings
from eidrive_scenario.api.criteria import Verdict


class CooperationGainSettings(RecalledSettings):
    """Settings: `{of: Ego, objects: all, range: 50, at_least: 0.1}`; limits are differences of shares, from -1 to 1."""

    at_least: Annotated[float, Field(ge=-1, le=1)] | None = None
    at_most: Annotated[float, Field(ge=-1, le=1)] | None = None


class CooperationGain(RecalledCriterion):
    """Criterion that fails if the recall of the fused minus the recall of the own objects is outside the limits.

    Both refer to the same true objects in the same frames. The gain is negative if fusion loses own objects.
    """

    settings_type = CooperationGainSettings
    name = "cooperation_gain"

    def __init__(self, settings: CooperationGainSettings) -> None:
        super().__init__(settings)
        self._settings = settings

    def _gain(self, group: Group) -> float | None:
        fused, own = self.recall("fused", group), self.recall("own", group)
        return None if fused is None or own is None else fused - own

    def verdict(self) -> Verdict:
        settings, group = self._settings, self._settings.objects
        value, fused, own = self._gain(group), self.recall("fused", group), self.recall("own", group)
        if not self.perceives:
            reason = self.no_perception()
        elif fused is None or own is None:
            reason = self.no_objects()
        else:
            of = f"{GROUPS[group]} within {settings.range:g} m"
            reason = f"{self.of} knew {100 * fused:.1f} % of {of}, with its own sensors {100 * own:.1f} %"
        return self.conclude(
            self.perceives and (value is None or settings.allows(value)),
            reason,
            value=value,
            limit=settings.limit_of(value),
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the gain of each group that had objects."""
        gains = {group: self._gain(group) for group in GROUPS}
        return {f"{self.name}.{self.of}.{group}": value for group, value in gains.items() if value is not None}
