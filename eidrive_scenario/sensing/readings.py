"""Sensor readings of one station at one instant."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.feature_map import FeatureMap
from eidrive_scenario.world.camera import CameraImage

NOTHING_ATTACHED: Array = np.empty((0, 7))
"""Boxes of the trailers of a station without one."""
NOTHING_ATTACHED.flags.writeable = False

FIELDS = frozenset({"truth", "camera", "lidar", "gnss", "imu"})
"""Kinds of sensors with a separate field in `Readings`."""


class EgoState(msgspec.Struct, frozen=True, gc=False):
    """Ego motion as measured by the station: reference point (3,) [m], angles [rad], speed along the heading [m/s]."""

    time: float
    position: Array
    yaw: float
    pitch: float
    roll: float
    speed: float
    yaw_rate: float
    acceleration: float
    """Acceleration along the heading [m/s²]."""


class TruthReading(msgspec.Struct, frozen=True, gc=False):
    """Objects in the line of sight of a truth sensor: the input of the oracle detector.

    names (N,), categories (N,), boxes (N, 7) in the world frame [m, rad], velocity (N, 2) of their centers [m/s],
    visibility (N,) share of the sampled points of each object that are in sight, in (0, 1]
    """

    names: tuple[str, ...]
    categories: tuple[str, ...]
    boxes: Array
    velocity: Array
    visibility: Array


class DeferredImage:
    """Image of a camera that is drawn when its pixels are read.

    size    width and height [px]
    draw    called for the first access to the image
    digest  returns the digest of everything that determines the image; None if it is unknown
    """

    def __init__(
        self, size: tuple[int, int], draw: Callable[[], CameraImage], digest: Callable[[], bytes] | None = None
    ) -> None:
        self.size = size
        self._draw = draw
        self._digest = digest

    @cached_property
    def digest(self) -> bytes | None:
        """Digest of everything that determines the image, None if it is unknown. Equal digests mean equal images."""
        return None if self._digest is None else self._digest()

    @cached_property
    def image(self) -> CameraImage:
        """The image, drawn by the first access."""
        image = self._draw()
        del self._draw  # the content is not needed any more
        self._digest = None
        return image


class CameraReading:
    """Image and camera pose.

    rgb (H, W, 3) uint8, depth (H, W) float32 along the optical axis [m], segmentation (H, W) int32: row of the actor in
    the view of the world, -1 for everything else; intrinsics (3, 3) [px], where pixel (j, i) covers [j, j + 1) x [i, i
    + 1); pose (4, 4) camera to world, camera frame x right, y down, z forward; distortion (5,) k1, k2, p1, p2, k3

    The image of a simulated camera is drawn by the first access to its pixels, so that an image that nothing reads
    takes no time.
    """

    __slots__ = ("_exposure", "distortion", "intrinsics", "pose")

    def __init__(
        self,
        rgb: NDArray[np.uint8],
        depth: NDArray[np.float32],
        segmentation: NDArray[np.int32],
        intrinsics: Array,
        pose: Array,
        distortion: Array | None = None,
    ) -> None:
        image = CameraImage(rgb, depth, segmentation)
        self._exposure = DeferredImage((rgb.shape[1], rgb.shape[0]), lambda: image)
        self.intrinsics, self.pose = intrinsics, pose
        self.distortion: Array = np.zeros(5) if distortion is None else distortion

    @classmethod
    def of(cls, exposure: DeferredImage, intrinsics: Array, pose: Array, distortion: Array) -> CameraReading:
        """Return a reading whose image is drawn when its pixels are read."""
        reading = cls.__new__(cls)
        reading._exposure = exposure
        reading.intrinsics, reading.pose, reading.distortion = intrinsics, pose, distortion
        return reading

    def at(self, pose: Array) -> CameraReading:
        """Return the same image with another pose (4, 4) of the camera."""
        return CameraReading.of(self._exposure, self.intrinsics, pose, self.distortion)

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """Image (H, W, 3)."""
        return self._exposure.image.rgb

    @property
    def depth(self) -> NDArray[np.float32]:
        """Distance of each pixel along the optical axis (H, W) [m]."""
        return self._exposure.image.depth

    @property
    def segmentation(self) -> NDArray[np.int32]:
        """Row of the actor in each pixel (H, W), -1 for everything else."""
        return self._exposure.image.segmentation

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self._exposure.size

    @property
    def image_digest(self) -> bytes | None:
        """Digest of everything that determines the image, None if it is unknown. Equal digests mean equal images."""
        return self._exposure.digest


class LidarReading(msgspec.Struct, frozen=True):
    """Lidar point cloud.

    points (N, 3) in the sensor frame [m], intensity (N,) in [0, 1]; pose (4, 4) sensor to world; ring (N,) number of
    the channel, 0 the highest; azimuth (N,) of the head at the measurement, from the x axis of the sensor to the left
    [rad]; rows (N,) row in the view of the actor with the point, the true label of datasets that no detector may read:
    -1 (GROUND) for the ground and buildings, -2 (NOTHING) for the air; duration from the first to the last point [s]
    """

    points: Array
    intensity: Array
    pose: Array
    ring: NDArray[np.int32] = msgspec.field(default_factory=lambda: np.empty(0, dtype=np.int32))
    azimuth: Array = msgspec.field(default_factory=lambda: np.empty(0))
    rows: NDArray[np.int32] = msgspec.field(default_factory=lambda: np.empty(0, dtype=np.int32))
    duration: float = 0.0

    @property
    def world_points(self) -> Array:
        """Points (N, 3) in the world frame [m]."""
        return np.asarray(self.points @ self.pose[:3, :3].T + self.pose[:3, 3])


class GnssReading(msgspec.Struct, frozen=True):
    """Position of the reference point of the station, measured by GNSS.

    position (3,) in the world frame [m], covariance (3, 3) of its error [m²]
    """

    position: Array
    covariance: Array


class ImuReading(msgspec.Struct, frozen=True):
    """Measurement of an IMU in the body frame, x forward, y left, z up.

    acceleration (3,) of the reference point without gravity [m/s²]; angular_rate (3,) about the axes [rad/s]
    """

    acceleration: Array
    angular_rate: Array


class SignalReading(msgspec.Struct, frozen=True):
    """Traffic light or stop sign in sight: its id in the road network, and its state."""

    id: str
    state: str


class Readings(msgspec.Struct, frozen=True, gc=False):
    """Readings of all sensors of one station; sensors that were not due in this tick are missing."""

    time: float
    ego: EgoState
    truth: TruthReading | None = None
    cameras: Mapping[str, CameraReading] = msgspec.field(default_factory=dict)
    lidars: Mapping[str, LidarReading] = msgspec.field(default_factory=dict)
    gnss: GnssReading | None = None
    imu: ImuReading | None = None
    signals: tuple[SignalReading, ...] = ()
    """Signals in sight, for stations with a signal sensor."""
    others: Mapping[str, Mapping[str, Any]] = msgspec.field(default_factory=dict)
    """Readings of all other sensors, by kind and name."""
    attached: Array = msgspec.field(default_factory=lambda: NOTHING_ATTACHED)
    """Boxes (K, 7) of the own trailers, whose angles the vehicle measures, in the world frame [m, rad]."""
    features: FeatureMap | None = None
    """Fused features of this tick: a detector of features detects objects in them instead of in the points."""
