"""The seam of perception: a Detector turns readings into boxes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import Readings, SignalReading
from eidrive_scenario.sensing.settings import SensorSettings
from eidrive_scenario.settings import Settings
from eidrive_scenario.world.actor import ActorSpec


@dataclass(frozen=True)
class DetectorContext:
    """Where a detector works: the body that carries it, its sensors by name, the map, and the run's seed."""

    spec: ActorSpec
    sensors: Mapping[str, SensorSettings] = field(default_factory=dict)
    roads: RoadNetwork | None = None
    seed: int = 0


class Detector(ABC):
    """Turns the readings of one station into boxes in the world frame. Built anew for each station and run.

    A class is registered in the entry points `eidrive_scenario.detectors`. It is built as `cls()`, or as
    `cls(settings)` where it has a `settings_type`: an instance of that, read from the controller's property
    `detector_settings`. It may raise SettingError while it is built. Then `load_weights` is called before a run, but
    not by `eidrive check`; then `setup` is called once, and `detect` in each tick in which all kinds of sensors in
    `needs` were read.
    """

    needs: ClassVar[frozenset[str]] = frozenset()
    """The kinds of sensors it reads: truth, camera, lidar."""
    default_sensors: ClassVar[Mapping[str, SensorSettings]] = {}
    """What a station gets, by name, that says nothing of its sensors; where empty, one of each kind in `needs`."""
    provides_velocity: ClassVar[bool] = False
    """Whether its boxes have velocities; those of others get them from a tracker, unless the station says otherwise."""
    detectable_signals: frozenset[str] = frozenset()
    """The kinds of signals that it reads, out of `light` and `stop sign`; the others a station knows by the map and the
    line of sight."""
    settings_type: ClassVar[type[Settings] | None] = None
    """What the property `detector_settings` may say; nothing where None."""
    image_detections: Mapping[str, ImageDetections] = MappingProxyType({})
    """What it found in the last picture of each camera, if it looks at pictures: they are kept with the boxes."""

    def load_weights(self, *, allow_torchscript: bool = False) -> None:  # noqa: B027 - a hook that most do not need
        """Load what the detector computes with, such as the weights of a network. May raise SettingError.

        `allow_torchscript`: whether the user lets files of weights execute code.
        """

    def setup(self, installation: DetectorContext) -> None:  # noqa: B027 - a hook that most do not need
        """Learn where it works, before the first reading."""

    @abstractmethod
    def detect(self, readings: Readings) -> Detections:
        """The objects in these readings."""

    def in_view(self, boxes: Array, readings: Readings, found: Detections) -> Array:
        """(N,) share in [0, 1] of each of these boxes (N, 7) that these readings can show, where `found` may hide it.

        A tracker does not expect to detect objects that are out of view. All are in view by default.
        """
        return np.ones(len(boxes))

    def signals(self) -> Sequence[SignalReading]:
        """Return the signals of the map found in the last readings, of the kinds in `detectable_signals`."""
        return ()
