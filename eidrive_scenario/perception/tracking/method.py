"""Interface and settings of trackers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field, PositiveInt, model_validator

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.extensions.settings import Settings, validate_by_kind, validate_nested
from eidrive_scenario.perception.tracking.association import BIRTH_DENSITY, DETECTION_PROBABILITY, LIFETIME
from eidrive_scenario.perception.tracking.uncertain_pose import PoseUncertainty

NO_TRACKER = "none"
"""Kind that passes detections on unchanged."""


class TrackerKind(Settings):
    """Settings of every tracker: the name under which it is registered."""

    kind: str


class TrackerSettings(TrackerKind):
    """Settings of the property `tracker`: a kind, or a mapping with these keys.

    kind      cv: constant velocity; ctrv: constant turn rate and speed; none
    confirm   n, m: an object is reported once it was detected in n of m successive scans that can show it, and
    confirm_existence   minimum probability of existence for that: 0.5 is the likelier of the two hypotheses
    delete_existence    probability of existence below which a track is deleted
    coast     maximum time without a detection, after which a track is deleted regardless of its existence [s]
    gate      probability that a detection of an object is within its gate
    detection_probability   of an object in full view, per scan
    birth_density       of new objects [1/m² per scan]
    lifetime  mean time that an object remains [s]

    The recursion of the probability of existence and the sources of its defaults are those of
    `eidrive_scenario.perception.tracking.association`.
    """

    kind: Literal["none", "cv", "ctrv"] = "cv"
    confirm: tuple[PositiveInt, PositiveInt] = (2, 3)
    confirm_existence: float = Field(default=0.5, ge=0.0, lt=1.0)
    delete_existence: float = Field(default=0.05, ge=0.0, lt=1.0)
    coast: float = Field(default=0.5, ge=0.0, le=1e4)
    gate: float = Field(default=0.99, gt=0.0, lt=1.0)
    detection_probability: float = Field(default=DETECTION_PROBABILITY, gt=0.0, lt=1.0)
    birth_density: float = Field(default=BIRTH_DENSITY, gt=0.0, le=1e6)
    lifetime: float = Field(default=LIFETIME, gt=0.0, le=1e6)

    @model_validator(mode="after")
    def _n_of_m(self) -> TrackerSettings:
        if self.confirm[0] > self.confirm[1]:
            n, m = self.confirm
            raise ValueError(f"confirm: n exceeds m (got [{n}, {m}]; expected [n, m] with n <= m)")
        if self.delete_existence > self.confirm_existence:
            delete, confirm = self.delete_existence, self.confirm_existence
            raise ValueError(f"delete_existence exceeds confirm_existence (got {delete:g} and {confirm:g})")
        return self


def tracker_setting(value: Any) -> Any:
    """Return the settings of the tracker that the property names; None selects the default of the detector.

    Keys without a kind are those of the built-in tracker.
    """
    if isinstance(value, str):
        value = {"kind": value}
    if not isinstance(value, Mapping):
        return value
    if value.get("kind", NO_TRACKER) == NO_TRACKER:
        return validate_nested(TrackerSettings, value)
    return validate_by_kind("trackers", value, TrackerKind, also=(NO_TRACKER,))


class TrackingMethod(ABC):
    """Tracker of one station: associates detections over time. Built as `cls(settings)` for each station and run.

    A class is registered in the entry points `eidrive_scenario.trackers`; the property `tracker` selects it by name.
    """

    settings_type: ClassVar[type[TrackerKind]] = TrackerKind
    """Type of the settings that the property `tracker` may give, if it is a mapping."""

    def __init__(self, settings: TrackerKind) -> None:
        self.settings = settings

    def setup(self, velocity_deviation: float) -> None:  # noqa: B027 - an optional hook
        """Store the deviation that the detector states of its velocities [m/s], before the first detections."""

    def set_pose(self, pose: PoseUncertainty) -> None:  # noqa: B027 - an optional hook
        """Store the pose of the station and its uncertainty; called in each time step, before the calls below, if the
        pose has random errors. With a latency of the detector, `update` gets detections of an earlier time step.

        Detections have a common error then, which their covariances do not contain.
        """

    @abstractmethod
    def update(self, detections: Detections, in_view: Callable[[Array], Array] | None = None) -> Detections:
        """Return the tracked objects at the time of these detections, with track numbers.

        in_view  returns the share (N,) in [0, 1] of boxes (N, 7) that the sensors can show; None: all of them
        """

    @abstractmethod
    def predict(self, time: float) -> Detections | None:
        """Return the objects predicted to a time after the last detections [s]; None if no prediction is possible."""
