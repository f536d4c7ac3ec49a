"""Criterion: arrival of an actor in a region."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field, model_validator

from eidrive_criteria.folds import Deadline
from eidrive_scenario.api.common import point_in_polygon
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict, actor_never_present

Point = tuple[float, float]


class ReachedRegionSettings(CriterionSettings):
    """Settings: `{of: Ego, region: [[0, 0], [10, 0], [10, 5], [0, 5]], by: 30}` with corners of the region [m], by [s].

    Two corners are opposite ones of a rectangle along the axes; three or more are the corners of a polygon in order. A
    fatal criterion ends the run at an expired deadline. Without `by` it is open until the end.
    """

    of: str
    region: Annotated[tuple[Point, ...], Field(min_length=2, max_length=1000)]
    by: Annotated[float, Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _has_an_area(self) -> Self:
        corners = self.polygon()
        doubled = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, (*corners[1:], corners[0]), strict=True))
        if abs(doubled) < 1e-9:
            raise ValueError("'region' has no area (expected two opposite corners or a polygon)")
        return self

    def polygon(self) -> tuple[Point, ...]:
        """Return the corners of the region in order."""
        if len(self.region) > 2:
            return self.region
        (x0, y0), (x1, y1) = self.region
        return (x0, y0), (x1, y0), (x1, y1), (x0, y1)


class ReachedRegion(Criterion):
    """Criterion that passes once the center of the actor has been inside the region, before the deadline.

    The value is the time of arrival, None without arrival; an actor that never arrives fails.
    """

    settings_type = ReachedRegionSettings
    name = "reached_region"
    unit = "s"
    demands_progress = True

    def __init__(self, settings: ReachedRegionSettings) -> None:
        super().__init__(settings)
        self._settings, self._polygon = settings, settings.polygon()
        self.subjects = (settings.of,)
        self._was_present = False
        self._reached: float | None = None
        self._deadline = Deadline(settings.by)

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        row = view.rows.get(settings.of)
        self._deadline.observe(view.time)
        if row is None:
            return
        self._was_present = True
        x, y, *_ = view.plain_boxes[row]
        if self._reached is None and self._deadline.expired is None and point_in_polygon(x, y, self._polygon):
            self._reached = view.time

    def verdict(self) -> Verdict:
        settings = self._settings
        if self._reached is not None:
            reason = f"{settings.of} reached the region at {self._reached:.2f} s"
        elif self._was_present:
            until = "" if settings.by is None else f" until {settings.by:.2f} s"
            reason = f"{settings.of} did not reach the region{until}"
        else:
            reason = actor_never_present([settings.of])
        return self.conclude(
            self._reached is not None,
            reason,
            value=self._reached,
            limit=settings.by,
            first_violation=self._deadline.expired if self._reached is None else None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the arrival time [s]; empty without arrival."""
        return {} if self._reached is None else {f"{self.name}.time": self._reached}
