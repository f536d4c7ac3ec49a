"""Base classes of criteria on the objects of a station, and on the share of the true objects that it knows."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from eidrive_criteria.folds import BoundedSettings
from eidrive_scenario.api.common import EPSILON, TIME_TOLERANCE, RoadNetwork, WorldView, wrap_angle
from eidrive_scenario.api.criteria import (
    Criterion,
    CriterionSettings,
    Frame,
    LinesOfSight,
    Source,
    Verdict,
    actor_never_present,
    known_actors,
)

ActorClass = Literal["car", "truck", "bus", "van", "motorbike", "bicycle", "pedestrian", "misc"]

VEHICLES: tuple[ActorClass, ...] = ("car", "truck", "bus", "van", "motorbike", "bicycle")
"""Classes of vehicles."""


class MatchedSettings(CriterionSettings):
    """Settings of the match of objects and actors: `{of: Ego, within: 2.0}`.

    within          maximum horizontal distance between the centers of an object and of its actor [m]
    min_confidence  minimum probability of existence of an object, or its score if there is no such probability
    """

    of: str
    within: Annotated[float, Field(gt=0, le=1000)] = 2.0
    min_confidence: Annotated[float, Field(ge=0, le=1)] = 0.0


class PerceivedSettings(MatchedSettings):
    """Settings: `{of: Ego, source: fused}` for the objects that the planner gets, `own` for the own detections."""

    source: Source = "fused"


class PerceivedCriterion(Criterion):
    """Criterion on the actors that a station knows. An actor without a driving stack is a failure."""

    def __init__(self, settings: MatchedSettings, to: str | None = None) -> None:
        super().__init__(settings)
        self._match = settings
        self.of = settings.of
        self.subjects = (settings.of,) if to is None else (settings.of, to)
        self._missing = set(self.subjects)
        self._has_stack = False

    @abstractmethod
    def evaluate(self, frame: Frame) -> None:
        """Process one frame with the step of the station."""

    def observe(self, frame: Frame) -> None:
        if self._missing:
            self._missing.difference_update(frame.view.names)
        if self.of not in frame.view.rows or self.of not in frame.steps:
            return
        self._has_stack = True
        self.evaluate(frame)

    @property
    def perceives(self) -> bool:
        """Whether the station had a driving stack, and all required actors were present."""
        return self._has_stack and not self._missing

    def known_actors(self, frame: Frame, source: Source) -> Mapping[str, float]:
        """Return the actors that the station knows from a source, with the distance of their object [m]."""
        given = self._match
        return known_actors(frame, self.of, source, within=given.within, min_confidence=given.min_confidence)

    def no_perception(self) -> str:
        """Return the reason of the verdict if a required actor was never present, or there is no driving stack."""
        if self._missing:
            return actor_never_present(self._missing)
        return f"{self.of} has no driving stack, so it detects nothing"


Group = Literal["all", "visible", "helper_only", "hidden"]
TRAFFIC: tuple[ActorClass, ...] = (*VEHICLES, "pedestrian")
"""Classes of vehicles and pedestrians."""
SILENCE = 1.0
"""Time without a message after which a station does not transmit [s]."""
SOURCES: tuple[Source, ...] = ("own", "fused")

GROUPS: Mapping[Group, str] = {
    "all": "all objects",
    "visible": "objects in its line of sight",
    "helper_only": "objects that only other stations have in sight",
    "hidden": "objects that no station has in sight",
}


class RecalledSettings(MatchedSettings, BoundedSettings):
    """Settings: `{of: Ego, objects: helper_only, range: 50, at_least: 0.8}`.

    objects  which true objects count: all; those `visible` to the station; those that a transmitting station only has
             in sight, `helper_only`; those `hidden` from all of these
    range    maximum horizontal distance of an object from the station, and from a helper that has it in sight [m]
    field_of_view  horizontal angle about the heading of the station in which an object can be visible to it [degrees]
    classes  true classes of the objects; None: vehicles and pedestrians
    """

    objects: Group = "all"
    range: Annotated[float, Field(gt=0, le=10_000)] = 50.0
    field_of_view: Annotated[float, Field(gt=0, le=360)] = 360.0
    classes: Annotated[tuple[ActorClass, ...], Field(min_length=1)] | None = None


class RecalledCriterion(PerceivedCriterion):
    """Criterion on the true objects around a station, without its trailers. Each counts once in each frame."""

    def __init__(self, settings: RecalledSettings) -> None:
        super().__init__(settings)
        self._recalled = settings
        self._classes = settings.classes or TRAFFIC
        self._sight = LinesOfSight(None)
        self._sent: dict[str, float] = {}
        """Time of the last message of each station [s]."""
        self.total = dict.fromkeys(GROUPS, 0)
        """Number of objects of each group over all frames."""
        self._known = {source: dict.fromkeys(GROUPS, 0) for source in SOURCES}

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        self._sight = LinesOfSight(roads)

    def observe(self, frame: Frame) -> None:
        self._sent.update((name, frame.view.time) for name, step in frame.steps.items() if step.outbox)
        super().observe(frame)

    def evaluate(self, frame: Frame) -> None:
        names_by_source = {source: self.known_actors(frame, source).keys() for source in SOURCES}
        for group, names in self._groups(frame).items():
            self.total[group] += len(names)
            for source in SOURCES:
                self._known[source][group] += len(names & names_by_source[source])

    def recall(self, source: Source, group: Group) -> float | None:
        """Return the share of the objects of a group that the station knows; None without such objects."""
        return self._known[source][group] / self.total[group] if self.total[group] else None

    @abstractmethod
    def value_of(self, group: Group) -> float | None:
        """Return the value of the criterion for a group of objects; None without such objects."""

    @abstractmethod
    def describe(self, objects: str) -> str:
        """Describe the value for the evaluated objects."""

    def verdict(self) -> Verdict:
        settings, value = self._recalled, self.value_of(self._recalled.objects)
        group, reach = GROUPS[settings.objects], f"within {settings.range:g} m"
        if not self.perceives:
            reason = self.no_perception()
        elif value is None:
            reason = f"there were no {group.removeprefix('all ')} {reach} of {self.of}"
        else:
            reason = self.describe(f"{group} {reach}")
        passed = self.perceives and (value is None or settings.allows(value))
        return self.conclude(passed, reason, value=value, limit=settings.limit_of(value))

    def metrics(self) -> Mapping[str, float]:
        """Return the value for each group that had objects."""
        values = {group: self.value_of(group) for group in GROUPS}
        return {f"{self.name}.{self.of}.{group}": value for group, value in values.items() if value is not None}

    def _groups(self, frame: Frame) -> dict[Group, set[str]]:
        """Return the names of the true objects in range, by group."""
        view, reach, attached = frame.view, self._recalled.range, frame.attached(self.of)
        own = view.rows[self.of]
        x, y, *_ = view.plain_boxes[own]
        near = {
            row
            for row, box in enumerate(view.plain_boxes)
            if row != own
            and view.names[row] not in attached
            and view.categories[row] in self._classes
            and (box[0] - x) ** 2 + (box[1] - y) ** 2 <= reach * reach
        }
        visible = {row for row in near & self._sight.visible(view, own, reach) if self._is_in_field(view, own, row)}
        hidden = near - visible
        helped: set[int] = set()
        for name in self._helpers(frame) if hidden else ():
            helper = view.rows[name]
            helped |= hidden & ({helper} | self._sight.visible(view, helper, reach))
        rows: dict[Group, set[int]] = {
            "all": near,
            "visible": visible,
            "helper_only": helped,
            "hidden": hidden - helped,
        }
        return {group: {view.names[row] for row in members} for group, members in rows.items()}

    def _is_in_field(self, view: WorldView, own: int, row: int) -> bool:
        """Return whether the center of an actor is in the field of view of the station."""
        (x, y, *_, yaw), (other_x, other_y, *_) = view.plain_boxes[own], view.plain_boxes[row]
        bearing = wrap_angle(math.atan2(other_y - y, other_x - x) - yaw)
        return abs(bearing) <= math.radians(self._recalled.field_of_view) / 2.0 + EPSILON

    def _helpers(self, frame: Frame) -> list[str]:
        """Return the present other stations that transmit: their last message is not older than SILENCE."""
        earliest = frame.view.time - SILENCE - TIME_TOLERANCE
        return [
            name
            for name, time in self._sent.items()
            if name != self.of and time >= earliest and name in frame.view.rows
        ]
