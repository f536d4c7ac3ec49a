"""Criterion: share of the driven distance outside the lanes, or in lanes of the opposite direction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from eidrive_criteria.folds import FollowedCriterion, exceeds
from eidrive_criteria.off_road import ALLOWED
from eidrive_criteria.wrong_lane import STILL, drives_against_lane
from eidrive_scenario.api.common import RoadNetwork, WorldView
from eidrive_scenario.api.criteria import CriterionSettings, Frame, LaneTracker, Step, Verdict, actor_never_present


class OutsideRouteLanesSettings(CriterionSettings):
    """Settings: `{of: Ego, at_most: 0, margin: 0.5, wrong_lanes: true}` with a share of the driven distance.

    margin       distance of the center from drivable and parking lanes up to which it is not outside [m]
    wrong_lanes  whether lanes of the opposite direction count as well
    """

    of: str
    at_most: Annotated[float, Field(ge=0, le=1)] = 0.0
    margin: Annotated[float, Field(ge=0, le=100)] = 0.5
    wrong_lanes: bool = True


class OutsideRouteLanes(FollowedCriterion):
    """Criterion that fails if more than a share `at_most` of the driven distance is outside the lanes.

    Outside is a center farther than `margin` from all drivable and parking lanes, or in a lane of the opposite
    direction. Junctions and lanes for both directions have no opposite direction.
    """

    settings_type = OutsideRouteLanesSettings
    name = "outside_route_lanes"
    needs_roads = True

    def __init__(self, settings: OutsideRouteLanesSettings) -> None:
        super().__init__(settings, settings.of)
        self._settings = settings
        self._outside = self._driven = 0.0
        self._first: float | None = None
        """First time outside [s]."""

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        if roads is not None:
            self._lanes = LaneTracker(roads)
            allowed = [lane.id != 0 and (lane.drivable or lane.type in ALLOWED) for lane in roads.tables.lanes]
            self._allowed = np.flatnonzero(allowed)
            """Rows of the drivable and parking lanes."""

    def interrupt(self) -> None:
        self._lanes.forget()

    def follow(self, frame: Frame, row: int, step: Step | None) -> None:
        if step is None or not exceeds(step.distance, STILL * step.duration):
            return
        self._driven += step.distance
        if self._is_outside(frame.view, row):
            self._outside += step.distance
            self._first = frame.view.time if self._first is None else self._first

    def _is_outside(self, view: WorldView, row: int) -> bool:
        if self._settings.wrong_lanes and drives_against_lane(self._lanes, view, row):
            return True
        x, y, *_ = view.plain_boxes[row]
        z, margin = view.states[row].z, self._settings.margin
        (types,) = self._lanes.types_at([(x, y, z)])
        return not types & ALLOWED and exceeds(self._lanes.roads.lane_gap(x, y, z, self._allowed, margin), margin)

    def verdict(self) -> Verdict:
        limit = self._settings.at_most
        if not self.was_present:
            return self.conclude(False, actor_never_present([self.of]), limit=limit)
        share = self._outside / self._driven if self._driven > 0.0 else 0.0
        passed = not exceeds(share, limit)
        reason = f"{self.of} drove {self._outside:.2f} m of {self._driven:.2f} m outside the lanes of its route"
        if self._first is not None:
            reason += f", first at {self._first:.2f} s"
        return self.conclude(
            passed,
            reason,
            value=share,
            limit=limit,
            first_violation=None if passed else self._first,
            is_final=limit == 0.0,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the distances driven outside and in total [m]."""
        if not self.was_present:
            return {}
        return {f"{self.name}.{self.of}.outside": self._outside, f"{self.name}.{self.of}.driven": self._driven}
