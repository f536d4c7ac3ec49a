"""Intermediate fusion: features of several stations are fused before objects are detected in them."""

from __future__ import annotations

import dataclasses
import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from msgspec.structs import replace
from pydantic import Field, PositiveFloat

from eidrive_scenario.base.arrays import Array, Bools, Floats, Integers
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.feature_map import LatentCodec
from eidrive_scenario.base.geometry import points_in_box
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.fusion.covariance_intersection import (
    CovarianceIntersectionFusion,
    CovarianceIntersectionSettings,
)
from eidrive_scenario.fusion.feature_warp import Grid, attend, scatter, warp
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pose_alignment import PoseAlignment, align_pose, aligned_report
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.result_checks import check_array
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.v2x.messages.feature_frames import Encoding, FeatureFrame, split, to_cells
from eidrive_scenario.v2x.messages.message import Payload

BOX_MARGIN = 0.8
"""Margin around a reported box within which cells move with it [m]: features of an object reach beyond its outline."""
_SMOOTHING = (0.054489, 0.244201, 0.40262, 0.244201, 0.054489)
"""Gaussian of 5 cells with a standard deviation of 1 cell, along one axis; the sum is 1."""


class IntermediateFusionSettings(CovarianceIntersectionSettings):
    """Settings of intermediate fusion (property `fusion_settings`). Inherited ones apply to fused boxes.

    share         share of the cells of a map that is sent, the most confident ones
    encoding      `int8`: 8 bytes per cell; `codes`: 1 byte per cell, an entry of the code book of the network
    max_lateness  maximum age of fused features, and maximum lead of the clock of their sender [s]
    """

    share: float = Field(default=1.0, gt=0.0, le=1.0)
    encoding: Encoding = "int8"
    max_lateness: PositiveFloat = 0.5


@dataclass
class _ReceivedMap:
    """Cells of the newest map of a station that have arrived.

    interval  time between the two scans in the features [s]; 0: they are of one scan and show no motion
    foot      height of the ground below the lidar in the world [m]
    latent (n, m, 8), present (n, m) whether the features of a cell have arrived
    """

    sequence: int
    time: float
    interval: float
    foot: float
    grid: Grid
    latent: Floats
    present: Bools


class _MovingBox(NamedTuple):
    """Reported box at `time` [s]: center, heading, length, width and velocity in the plane [m, rad, m/s]."""

    time: float
    x: float
    y: float
    yaw: float
    length: float
    width: float
    vx: float
    vy: float


class IntermediateFusion(CovarianceIntersectionFusion):
    """Abstract base class of fusion methods for features: a station sends cells of its features beside its boxes.

    Received cells are placed on the grid of the station by the poses of both, and moved by the velocity of the reported
    box in which they are. `fuse_maps` of a derived class fuses them with the features of the station, and the detector
    detects objects in the result. Boxes of other stations without features in the last result are fused by covariance
    intersection. The station reports only objects in its own features.
    """

    settings_type = IntermediateFusionSettings
    settings: IntermediateFusionSettings

    shares: ClassVar[Literal["points", "features"] | None] = "features"

    def __init__(self, settings: IntermediateFusionSettings | None = None) -> None:
        super().__init__(settings)
        self._detector: Detector | None = None
        self._maps = 0
        """Number of maps of this station."""
        self._grid: Grid | None = None
        """Grid of the last map of this station."""
        self._received: dict[str, _ReceivedMap] = {}
        self._merged: dict[str, _ReceivedMap] = {}
        """Maps of other stations in the last fused map that are not too old."""
        self._alone: Detections | None = None
        """Newest objects in the own features."""
        self._reports: dict[str, Report] = {}
        """Newest report of each station."""
        self._boxes: dict[str, dict[int, _MovingBox]] = {}
        """Newest moving boxes of each station, by object."""

    @abstractmethod
    def fuse_maps(self, own: Floats, received: Floats, present: Bools) -> Floats:
        """Return the fused features (C, n, m), at least 0.

        own       (C, n, m) features of the station
        received  (S, C, n, m) features of S other stations on the same grid, 0 in absent cells
        present   (S, n, m) whether the features of a station are present in a cell
        """

    @property
    def max_payload_age(self) -> float:
        return self.settings.max_lateness

    def setup(self, detector: Detector) -> None:
        self._detector = detector

    @property
    def _codec(self) -> LatentCodec:
        codec = None if self._detector is None else self._detector.codec
        if codec is None:
            raise InvalidResult(self._detector, "codec", "is None (expected the codec of the features)")
        return codec

    def payloads(self, readings: Readings, limit: int) -> tuple[Payload, ...]:
        """Return the frames of the most confident cells of new features."""
        features = readings.features
        if features is None:
            return ()
        codec, settings = self._codec, self.settings
        confidence = _smoothed(features.confidence).ravel()
        count = max(1, round(settings.share * confidence.size))
        chosen = np.argsort(-confidence, kind="stable")[:count]
        latent = features.latent.reshape(len(features.latent), -1)[:, chosen]
        codes = codec.to_int8(latent) if settings.encoding == "int8" else codec.to_codes(latent)
        rows, columns = features.confidence.shape
        self._maps += 1
        whole = FeatureFrame(
            0, self._maps % 65536, 0, 1, features.time, features.x, features.y, features.yaw,
            features.interval or 0.0, features.foot, features.cell, (rows, columns), settings.encoding,
            float(codec.scale), to_cells(chosen, codes),
        )  # fmt: skip
        return split(whole, limit)

    def add_payload(self, sender: str, payload: Payload, body: Array) -> None:
        """Add the cells of a frame to the map of their sender; a newer map replaces it.

        Frames of older maps, and those that do not match the map or the network, are ignored.
        """
        if not isinstance(payload, FeatureFrame) or payload.scale != float(np.float32(self._codec.scale)):
            return
        try:
            payload.check()
        except ValueError:
            return
        integers = payload.encoding == "int8"
        latent = self._codec.from_int8(payload.integers) if integers else self._codec.from_codes(payload.codes)
        grid = Grid(payload.x, payload.y, payload.yaw, payload.cell, payload.shape)
        held = self._received.get(sender)
        if held is None or (held.sequence, held.grid) != (payload.sequence, grid):
            if held is not None and payload.time <= held.time:
                return
            values, present = np.zeros((*grid.shape, len(latent)), np.float32), np.zeros(grid.shape, np.bool_)
            held = self._received[sender] = _ReceivedMap(
                payload.sequence, payload.time, payload.interval, payload.foot, grid, values, present
            )
        cells = np.stack(np.unravel_index(payload.indices, grid.shape), axis=-1)
        length, width = body[3] + grid.cell, body[4] + grid.cell  # all cells that overlap with the body
        outline = np.array([*body[:2], 0.0, length, width, 1.0, body[6]])
        kept = ~points_in_box(np.column_stack([grid.to_world(cells), np.zeros(len(cells))]), outline)
        rows, columns = cells[kept].T
        held.latent[rows, columns] = latent.T[kept]
        held.present[rows, columns] = True

    def add_report(self, report: Report) -> None:
        """Store the moving boxes of a report, and process it.

        Out-of-sequence reports do not replace the moving boxes of a newer one.
        """
        station = report.station
        newest = self._reports.get(station)
        # A report that is older by more than this is not late: the clock of its sender was set back.
        if newest is None or not 0.0 < newest.detections.time - report.detections.time <= self.settings.max_age:
            self._reports[station] = report
            self._boxes[station] = self._moving_boxes(report)
        if station not in self._merged:
            super().add_report(report)
            return
        # To the objects in the own features alone: those in the fused ones are partly its own.
        alignment = self._alignment(report)
        if alignment is not None and alignment.is_corrected:
            # Errors of successive corrections are independent at most.
            report = replace(aligned_report(report, alignment), pose_change=2.0 * alignment.covariance)
        self._history.add_report(report)

    def _omitted(self, rows: Integers, ranks: Integers) -> Bools | None:
        """Return which objects are in the fused features of their stations."""
        omitted = np.zeros(len(rows), np.bool_)
        for rank, station in enumerate(self._order[1]):
            if station in self._merged:
                of_station = np.flatnonzero(ranks == rank)
                omitted[of_station] = self._covered(self._merged[station], self._history.positions(rows[of_station]))
        return omitted

    def _alignment(self, report: Report) -> PoseAlignment | None:
        """Return the pose of a sender, aligned to the objects in the own features; None if the pose is not aligned."""
        if not self.settings.align_poses or self._alone is None or report.state is None:
            return None
        return align_pose(self._alone, report)

    def _moving_boxes(self, report: Report) -> dict[int, _MovingBox]:
        """Return the moving boxes of a station after a report, by object."""
        detections = report.detections
        held = {} if report.complete else self._boxes.get(report.station, {})
        now, max_age = detections.time, self.settings.max_age + TIME_TOLERANCE
        boxes = {number: box for number, box in held.items() if abs(now - box.time) <= max_age}
        numbers = detections.tracks or range(len(detections))
        for number, box, (vx, vy) in zip(numbers, detections.boxes.tolist(), detections.velocity.tolist(), strict=True):
            boxes.pop(number, None)
            if math.hypot(vx, vy) > 0.0:  # not if it is unknown
                x, y, _, length, width, _, yaw = box
                boxes[number] = _MovingBox(now, x, y, yaw, length, width, vx, vy)
        return boxes

    def _covered(self, merged: _ReceivedMap, points: Array) -> Bools:
        """Return whether the features at points (N, 2) of the world are in the fused map."""
        inside = np.zeros(len(points), np.bool_) if self._grid is None else self._grid.cells(points)[1]
        cells, in_map = merged.grid.cells(points)
        covered: Bools = inside & in_map
        covered[covered] = merged.present[tuple(cells[covered].T)]
        return covered

    def merge_readings(self, readings: Readings, alone: Detections | None = None) -> Readings:
        """Return the readings with fused features; without lidars if there are no new features."""
        self._alone = self._alone if alone is None else alone
        oldest = readings.time - self.max_payload_age - TIME_TOLERANCE
        self._received = {sender: held for sender, held in self._received.items() if held.time >= oldest}
        self._merged = {sender: held for sender, held in self._merged.items() if held.time >= oldest}
        features = readings.features
        if features is None:
            return replace(readings, lidars={})
        # Cells that arrive later are not in the fused map.
        self._merged = {
            sender: dataclasses.replace(held, present=held.present.copy()) for sender, held in self._received.items()
        }
        self._grid = Grid.of(features)
        if not self._received:
            return readings
        received = np.zeros((len(self._received), *features.features.shape), np.float32)
        present = np.zeros((len(self._received), *self._grid.shape), np.bool_)
        for station, (sender, held) in enumerate(sorted(self._received.items())):
            moving = np.array([
                (x + vx * (held.time - time), y + vy * (held.time - time), yaw, length + 2.0 * BOX_MARGIN,
                 width + 2.0 * BOX_MARGIN, vx, vy)
                for time, x, y, yaw, length, width, vx, vy in self._boxes.get(sender, {}).values()
                if abs(held.time - time) <= self.settings.max_age + TIME_TOLERANCE
            ]).reshape(-1, 7)  # fmt: skip
            grid, age = self._grid_for(self._reports.get(sender), held, readings), features.time - held.time
            latent, present[station] = warp(held.latent, held.present, held.grid, grid, moving, age)
            self._expand(latent, present[station], received[station])
        fused = self.fuse_maps(features.features, received, present)
        check_array(self, "fuse_maps", "features", fused, features.features.shape)
        # Features of one scan contain an arbitrary motion, so that no velocity in the fused ones is known.
        interval = features.interval if all(held.interval for held in self._received.values()) else None
        return replace(readings, features=replace(features, features=fused, interval=interval))

    def _expand(self, latent: Floats, present: Bools, features: Floats) -> None:
        """Set the features (C, n, m) of the present cells from compressed ones (n, m, 8)."""
        scatter(self._codec.expand(np.ascontiguousarray(latent[present].T)), present, features)

    def _grid_for(self, report: Report | None, held: _ReceivedMap, readings: Readings) -> Grid:
        """Return the own grid relative to the pose that a sender states, from which objects of both may differ.

        These are the objects in its map. The boxes of a CPM have the pose error of their time, not that of the map, and
        a tracker has removed a part of it.
        """
        detector, features = self._detector, readings.features
        assert detector is not None
        assert features is not None
        grid = Grid.of(features)
        state = None if report is None or not self.settings.align_poses else report.state
        if report is None or state is None or state.pose_covariance is None or held.grid.shape != grid.shape:
            return grid
        theirs = np.zeros_like(features.features)
        self._expand(held.latent, held.present, theirs)
        sender = held.grid
        shared = replace(
            features, time=held.time, x=sender.x, y=sender.y, yaw=sender.yaw, foot=held.foot, cell=sender.cell,
            features=theirs, interval=held.interval or None,
        )  # fmt: skip
        objects = detector.detect(replace(readings, time=held.time, features=shared))
        alignment = self._alignment(replace(report, detections=objects))
        if alignment is None:
            return grid
        x, y, _ = alignment.pose
        ex, ey, turn = alignment.error.tolist()
        dx, dy = grid.x - x, grid.y - y
        cos, sin = math.cos(turn), math.sin(turn)
        return dataclasses.replace(
            grid, x=x + ex + cos * dx - sin * dy, y=y + ey + sin * dx + cos * dy, yaw=grid.yaw + turn
        )


class MaxFusion(IntermediateFusion):
    """Maximum of the features of all stations (F-Cooper: Chen et al., SEC 2019)."""

    def fuse_maps(self, own: Floats, received: Floats, present: Bools) -> Floats:
        fused = own.copy()
        for features, is_present in zip(received, present, strict=True):
            np.maximum(fused, features, out=fused, where=is_present)
        return fused


class AttentionFusion(IntermediateFusion):
    """Attention of the own features to those of all stations in each cell (AttFuse: Xu et al., OPV2V, ICRA 2022)."""

    def fuse_maps(self, own: Floats, received: Floats, present: Bools) -> Floats:
        return attend(own, received, present)


class Where2commSettings(IntermediateFusionSettings):
    """Settings of the fusion method `where2comm`: those of intermediate fusion, with a share of 1 %."""

    share: float = Field(default=0.01, gt=0.0, le=1.0)


class Where2commFusion(AttentionFusion):
    """Attention to the most confident cells of other stations (Where2comm: Hu et al., NeurIPS 2022)."""

    settings_type = Where2commSettings


def _smoothed(confidence: Floats) -> Array:
    """Return the confidence (n, m) after a Gaussian of 5 x 5 cells, with zeros beyond the border."""
    rows, columns = confidence.shape
    padded, smoothed = np.pad(confidence.astype(np.float64), 2), np.zeros(confidence.shape)
    for i, along in enumerate(_SMOOTHING):
        for j, across in enumerate(_SMOOTHING):
            smoothed += along * across * padded[i : i + rows, j : j + columns]
    return smoothed
