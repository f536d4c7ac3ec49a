"""Base class of criteria on the objects that a station knows."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Source, actor_never_present, known_actors

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

    def __init__(self, settings: MatchedSettings) -> None:
        super().__init__(settings)
        self._match = settings
        self.of = settings.of
        self.subjects: tuple[str, ...] = (settings.of,)
        self._was_present = self.perceives = False
        """Whether the station was present, and whether it had a driving stack."""

    @abstractmethod
    def evaluate(self, frame: Frame) -> None:
        """Process one frame with the step of the station."""

    def observe(self, frame: Frame) -> None:
        if self.of not in frame.view.rows:
            return
        self._was_present = True
        if self.of not in frame.steps:
            return
        self.perceives = True
        self.evaluate(frame)

    def known(self, frame: Frame, source: Source) -> Mapping[str, float]:
        """Return the actors that the station knows from a source, with the distance of their object [m]."""
        given = self._match
        return known_actors(frame, self.of, source, within=given.within, min_confidence=given.min_confidence)

    def no_perception(self) -> str:
        """Return the reason of the verdict on a station that was never present or has no driving stack."""
        if self._was_present:
            return f"{self.of} has no driving stack, so it detects nothing"
        return actor_never_present([self.of])
