"""Criterion: gain in recall by cooperation, within one run."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from eidrive_criteria.perceived import Group, RecalledCriterion, RecalledSettings


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

    def value_of(self, group: Group) -> float | None:
        fused, own = self.recall("fused", group), self.recall("own", group)
        return None if fused is None or own is None else fused - own

    def describe(self, objects: str) -> str:
        fused, own = (100 * (self.recall(source, self._settings.objects) or 0.0) for source in ("fused", "own"))
        return f"{self.of} knew {fused:.1f} % of {objects}, with its own sensors {own:.1f} %"
