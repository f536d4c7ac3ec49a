"""Late fusion by covariance intersection: tracks are predicted to a common time; error correlations are unknown."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import ClassVar

import numpy as np
from pydantic import Field, PositiveFloat

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import CLASSES, Detections
from eidrive_scenario.fusion.covariance import covariances, estimates, fuse, means
from eidrive_scenario.fusion.grouping import group_tracks
from eidrive_scenario.fusion.headings import fuse_headings
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.fusion.pairs import AssociationGate, Table
from eidrive_scenario.fusion.report_history import ReportHistory
from eidrive_scenario.fusion.tracks import predict_tracks
from eidrive_scenario.settings import Settings
from eidrive_scenario.tolerances import TIME_TOLERANCE


class CovarianceIntersectionSettings(Settings):
    """Settings of covariance intersection (property `fusion_settings`).

    gate           probability that two estimates of one object are within the association gate
    gate_distance  maximum distance between centers of one object if a report has no covariance [m]
    max_age        time after the last report of an object at which its track is deleted, and maximum delay of reports
                   [s]; objects at rest are reported once per second (ETSI TS 103 324, T_GenCpmMax)
    existence      minimum existence probability of reported objects; from 0.5 existence is the likelier hypothesis
    """

    gate: float = Field(default=0.99, gt=0.0, lt=1.0)
    gate_distance: PositiveFloat = 4.0
    max_age: PositiveFloat = 1.5
    existence: float = Field(default=0.5, ge=0.0, le=1.0)


class CovarianceIntersectionFusion(FusionMethod):
    """Track-to-track fusion: tracks of every station are predicted to the current time and fused per object.

    Reports of one station are filtered in order of measurement, independent of their arrival (see ReportHistory). The
    correlation of errors between stations is unknown: they share motion models, maps, and views of an object.
    Covariance intersection is consistent for any correlation, and so avoids data incest. Stations are processed in
    order of their names; each object has at most one track per station, because a station reports different objects.
    Existence probabilities of stations are independent, because stations report only detections of their sensors: an
    object exists if at least one report is correct, 1 - prod (1 - r).
    """

    settings_type: ClassVar[type[Settings] | None] = CovarianceIntersectionSettings

    def __init__(self, settings: CovarianceIntersectionSettings | None = None) -> None:
        self.settings = settings or CovarianceIntersectionSettings()
        self._gate = AssociationGate.of(self.settings.gate, self.settings.gate_distance)
        self._history = ReportHistory(self.settings.max_age, self._gate)

    def add_report(self, report: Report) -> None:
        self._history.add_report(report)

    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        self._history.evict_stale(now)
        tracks = self._history.tracks()
        names = self._history.stations
        rank: dict[str | None, int] = {
            name: place for place, name in enumerate(sorted({report.station for report in reports}))
        }
        station = np.array([rank.get(name, -1) for name in names], dtype=np.int64)[tracks["station"]]
        rows = np.flatnonzero((station >= 0) & (now - tracks["seen"] <= self.settings.max_age + TIME_TOLERANCE))
        if not len(rows):
            return Detections(now)
        rows = rows[np.argsort(station[rows], kind="stable")]
        present = tracks[rows]
        predict_tracks(present, np.full(len(rows), now))
        present["station"] = station[rows]
        objects = group_tracks(present, self._gate)
        return _fuse_objects(present, objects, now, self.settings.existence, self._gate.chi_square)


def _fuse_objects(tracks: Table, objects: list[list[int]], now: float, least: float, gate: float) -> Detections:
    """Return one box per object with an existence probability of at least `least`.

    gate  squared Mahalanobis distance above which estimates disagree
    """
    rows = np.array([row for members in objects for row in members], dtype=np.intp)
    starts = np.cumsum([0, *(len(members) for members in objects[:-1])])
    members = tracks[rows]
    existence = 1.0 - np.multiply.reduceat(1.0 - members["existence"], starts)
    mean, covariance = _fuse_states(tracks, objects, gate)
    known = np.logical_or.reduceat(members["moving"], starts)
    velocity = np.where(known[:, None], mean[:, 1], np.nan)
    weights = np.maximum(members["score"], 1e-6)
    shares = weights / np.repeat(np.add.reduceat(weights, starts), [len(group) for group in objects])
    body = np.add.reduceat(shares[:, None] * members["body"], starts, axis=0)
    boxes = np.empty((len(objects), 7))
    boxes[:, :2], boxes[:, 2:6] = mean[:, 0], body
    errors = np.trace(members["covariance"][:, :2, :2] + members["pose"], axis1=1, axis2=2)
    boxes[:, 6] = fuse_headings(members["heading"][:, 0], weights, errors, starts, velocity)
    votes = members["votes"] / np.maximum(members["votes"].sum(axis=1, keepdims=True), 1e-12)
    words = np.argmax(np.add.reduceat(weights[:, None] * votes, starts, axis=0), axis=1)
    fused = Detections(
        now,
        boxes,
        1.0 - np.multiply.reduceat(1.0 - members["score"], starts),
        tuple(CLASSES[word] for word in words.tolist()),
        velocity,
        covariance,
        existence=existence,
    )
    likely = np.flatnonzero(existence >= least)
    return fused if len(likely) == len(fused) else fused.subset(likely.tolist())


def _fuse_states(tracks: Table, objects: list[list[int]], gate: float) -> tuple[Array, Array]:
    """Return positions and velocities (G, 2, 2) of the objects, and covariances of their positions (G, 2, 2).

    Position and velocity are fused separately, because their units differ. Members are fused in pairs, then the results
    in pairs, and so on: any order is consistent.
    """
    covariance = np.empty((len(tracks), 2, 2, 2))
    covariance[:, 0] = tracks["covariance"][:, :2, :2] + tracks["pose"]
    covariance[:, 1] = tracks["covariance"][:, 2:, 2:]
    known = estimates(tracks["mean"].reshape(-1, 2, 2), covariance)
    groups, count = objects, len(tracks)
    while pairs := [
        pair for members in groups if len(members) > 1 for pair in zip(members[::2], members[1::2], strict=False)
    ]:
        first, second = zip(*pairs, strict=True)
        fresh = fuse(known.take(first, axis=1), known.take(second, axis=1), gate)
        known = np.concatenate([known, fresh], axis=1)
        places = iter(range(count, count + len(pairs)))
        groups = [
            members if len(members) == 1 else [*islice(places, len(members) // 2), *members[len(members) // 2 * 2 :]]
            for members in groups
        ]
        count += len(pairs)
    final = known.take([members[0] for members in groups], axis=1)
    return means(final), covariances(final[:, :, 0])
