"""Late fusion by covariance intersection: tracks are predicted to a common time; error correlations are unknown."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, PositiveFloat

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.detections import CLASSES, Detections
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.fusion.covariance import covariances, estimates, fuse, means
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.fusion.pairs import AssociationGate, Objects, Table, group_tracks
from eidrive_scenario.fusion.pose_alignment import PoseAligner
from eidrive_scenario.fusion.prediction import REPORT_LIFETIME, fuse_headings, is_predictable
from eidrive_scenario.fusion.report_history import ReportHistory
from eidrive_scenario.fusion.tracks import TRACK, predict_tracks, rows_of

_BATCH = 16
"""Maximum number of receiving stations whose tracks are processed at once, so that their arrays fit in the cache."""
_WEIGHTLESS = 1e12
"""Variance of velocities that are not reported, and are not fused with those that are [m²/s²]."""


class CovarianceIntersectionSettings(Settings):
    """Settings of covariance intersection (property `fusion_settings`).

    gate           probability that two estimates of one object are within the association gate
    gate_distance  maximum distance between centers of one object if a report has no covariance [m]
    max_age        time after the last report of an object at which its track is deleted, and maximum age of reports [s]
    existence      minimum existence probability of reported objects; from 0.5 existence is the likelier hypothesis
    align_poses    whether the pose of a sender that states its covariance is corrected by shared objects
    """

    gate: float = Field(default=0.99, gt=0.0, lt=1.0)
    gate_distance: PositiveFloat = 4.0
    max_age: PositiveFloat = REPORT_LIFETIME
    existence: float = Field(default=0.5, ge=0.0, le=1.0)
    align_poses: bool = False


class CovarianceIntersectionFusion(FusionMethod):
    """Track-to-track fusion: tracks of every station are predicted to the current time and fused per object.

    Reports of one station are filtered in order of measurement, independent of their arrival (see ReportHistory). The
    correlation of errors between stations is unknown: they share motion models, maps, and views of an object.
    Covariance intersection is consistent for any correlation, and so avoids data incest. Stations are processed in
    order of their names; each object has at most one track per station, because a station reports different objects.
    For the same reason the reports of senders about themselves count as one station, which is the first.
    Existence probabilities of stations are independent, because stations report only detections of their sensors: an
    object exists if at least one report is correct, 1 - prod (1 - r).
    """

    settings_type: ClassVar[type[CovarianceIntersectionSettings]] = CovarianceIntersectionSettings

    def __init__(self, settings: CovarianceIntersectionSettings | None = None) -> None:
        self.settings = settings or self.settings_type()
        self._gate = AssociationGate.of(self.settings.gate, self.settings.gate_distance)
        self._history = ReportHistory(self.settings.max_age, self._gate)
        self._aligner = PoseAligner(self._history) if self.settings.align_poses else None
        self._order: tuple[tuple[str, ...], tuple[str, ...], int] = (), (), 0
        """Stations of the last reports, the same in their order, and the number of those that report themselves."""

    @property
    def max_report_age(self) -> float:
        return self.settings.max_age

    def add_report(self, report: Report) -> None:
        (self._aligner or self._history).add_report(report)

    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        return _fuse_batch([self], [reports], now)[0]

    @classmethod
    def fuse_batch(
        cls, methods: Sequence[Self], reports: Sequence[Sequence[Report]], now: float
    ) -> Sequence[Detections]:
        if cls.fuse is not CovarianceIntersectionFusion.fuse:
            return super().fuse_batch(methods, reports, now)
        batches: dict[tuple[float, ...], list[int]] = {}
        for index, method in enumerate(methods):
            settings = method.settings
            key = settings.gate, settings.gate_distance, settings.max_age, settings.existence, settings.align_poses
            batches.setdefault(key, []).append(index)
        fused: dict[int, Detections] = {}
        for indices in batches.values():
            for start in range(0, len(indices), _BATCH):
                part = indices[start : start + _BATCH]
                results = _fuse_batch([methods[index] for index in part], [reports[index] for index in part], now)
                fused.update(zip(part, results, strict=True))
        return [fused[index] for index in range(len(methods))]

    def _select(self, reports: Sequence[Report]) -> tuple[Integers, Integers]:
        """Return the rows of the tracks of the stations of these reports in order of their names, and the ranks of the
        stations."""
        names = tuple([report.station for report in reports])
        if names != self._order[0]:
            senders = {report.station for report in reports if report.describes_sender}
            self._order = names, (*sorted(senders), *sorted(set(names) - senders)), len(senders)
        rows, ranks = self._history.select(self._order[1])
        omitted = self._omitted(rows, ranks)
        if omitted is not None:
            rows, ranks = rows[~omitted], ranks[~omitted]
        return rows, np.maximum(ranks - (self._order[2] - 1), 0) if self._order[2] else ranks

    def _omitted(self, rows: Integers, ranks: Integers) -> Bools | None:
        """Return which tracks (N,) are omitted, None for none: those of objects in merged sensor data.

        rows, ranks  (N,) of the tracks in the history, and of their stations in `_order[1]`
        """
        return None


def _fuse_batch(
    methods: Sequence[CovarianceIntersectionFusion], reports: Sequence[Sequence[Report]], now: float
) -> list[Detections]:
    """Return the objects of several receiving stations, whose methods have equal settings."""
    settings, gate = methods[0].settings, methods[0]._gate
    histories = [method._history for method in methods]
    ReportHistory.process(histories)
    if settings.align_poses:
        for method in methods:
            if method._aligner is not None:
                method._aligner.align(now)
        ReportHistory.process(histories)
    for method in methods:
        method._history.evict_stale(now)
    rows, ranks = zip(*(method._select(held) for method, held in zip(methods, reports, strict=True)), strict=True)
    counts = [len(part) for part in rows]
    tracks: Table = np.empty(sum(counts), TRACK)
    ends = np.cumsum(counts).tolist()
    for method, part, end in zip(methods, rows, ends, strict=True):
        method._history.copy_rows(part, rows_of(tracks)[end - len(part) : end])
    tracks["receiver"] = np.repeat(np.arange(len(methods)), counts)
    tracks["station"] = np.concatenate(ranks)
    recent = now - tracks["seen"] <= settings.max_age + TIME_TOLERANCE
    if not recent.all():
        tracks = tracks.take(np.flatnonzero(recent))
    predict_tracks(tracks, np.full(len(tracks), now))
    # The first velocities of a tracker are uncertain. Without a further report such an object may be anywhere soon.
    lasting = ~tracks["judged"] | is_predictable(tracks["covariance"], now - tracks["seen"], settings.max_age)
    if not lasting.all():
        tracks = tracks.take(np.flatnonzero(lasting))
    if not len(tracks):
        return [Detections(now) for _ in methods]
    objects = group_tracks(tracks, gate)
    fused = _fuse_objects(tracks, objects, now, gate.chi_square)
    likely = fused.existence >= settings.existence
    if len(methods) == 1:
        return [fused if likely.all() else fused.subset(np.flatnonzero(likely).tolist())]
    receiver = tracks["receiver"][objects.rows[objects.starts]]
    if not likely.all():
        fused, receiver = fused.subset(np.flatnonzero(likely).tolist()), receiver[likely]
    ends = np.searchsorted(receiver, np.arange(len(methods)), "right").tolist()
    return [_slice(fused, start, end) for start, end in pairwise([0, *ends])]


def _slice(fused: Detections, start: int, end: int) -> Detections:
    """Return consecutive objects, which share the memory of all."""
    return Detections(
        fused.time,
        fused.boxes[start:end],
        fused.scores[start:end],
        fused.classes[start:end],
        fused.velocity[start:end],
        fused.covariance[start:end],
        existence=fused.existence[start:end],
    )


def _fuse_objects(tracks: Table, objects: Objects, now: float, gate: float) -> Detections:
    """Return one box per object.

    gate  squared Mahalanobis distance above which estimates disagree
    """
    rows, starts = objects
    count = len(starts)
    members = tracks if count == len(rows) else tracks.take(rows)
    # A detector that measures velocities compares scans, which its reports share: they are not independent. They
    # confirm that an object persists, but it is no more likely than its last score.
    compared = members["measured"] & ~members["judged"]
    limits = np.where(compared, members["score"], 1.0)
    existence = 1.0 - np.multiply.reduceat(1.0 - np.minimum(members["existence"], limits), starts)
    mean, covariance = _fuse_states(tracks, objects, gate)
    has_velocity = np.logical_or.reduceat(members["moving"], starts)
    velocity = np.where(has_velocity[:, None], mean[:, 1], np.nan)
    weights = np.maximum(members["score"], 1e-6)
    shares = weights / np.repeat(np.add.reduceat(weights, starts), np.diff(starts, append=len(rows)))
    body = np.add.reduceat(shares[:, None] * members["body"], starts, axis=0)
    boxes = np.empty((count, 7))
    boxes[:, :2], boxes[:, 2:6] = mean[:, 0], body
    errors = np.trace(members["covariance"][:, :2, :2] + members["pose"], axis1=1, axis2=2)
    boxes[:, 6] = fuse_headings(members["heading"][:, 0], weights, errors, starts, velocity)
    votes = members["votes"] / np.maximum(members["votes"].sum(axis=1, keepdims=True), 1e-12)
    words = np.argmax(np.add.reduceat(weights[:, None] * votes, starts, axis=0), axis=1)
    return Detections(
        now,
        boxes,
        1.0 - np.multiply.reduceat(1.0 - members["score"], starts),
        tuple(CLASSES[word] for word in words.tolist()),
        velocity,
        covariance,
        existence=existence,
    )


def _fuse_states(tracks: Table, objects: Objects, gate: float) -> tuple[Array, Array]:
    """Return positions and velocities (G, 2, 2) of the objects, and covariances of their positions (G, 2, 2).

    Position and velocity are fused separately, because their units differ. Members are fused in pairs, then the results
    in pairs, and so on: any order is consistent.
    """
    covariance = np.empty((len(tracks), 2, 2, 2))
    covariance[:, 0] = tracks["covariance"][:, :2, :2] + tracks["pose"]
    covariance[:, 1] = tracks["covariance"][:, 2:, 2:]
    covariance[~tracks["moving"], 1] = _WEIGHTLESS * np.eye(2)
    states = estimates(tracks["mean"].reshape(-1, 2, 2), covariance)
    members, starts = objects
    while len(members) > len(starts):
        counts = np.diff(starts, append=len(members))
        order = np.arange(len(members)) - np.repeat(starts, counts)
        first = np.flatnonzero((order % 2 == 0) & (order + 1 < np.repeat(counts, counts)))
        pair = states.take(members[first], axis=1), states.take(members[first + 1], axis=1)
        members = members.copy()
        members[first] = states.shape[1] + np.arange(len(first))
        members = np.delete(members, first + 1)
        states = np.concatenate([states, fuse(*pair, gate)], axis=1)
        starts = np.cumsum([0, *((counts + 1) // 2)[:-1].tolist()])
    final = states.take(members, axis=1)
    return means(final), covariances(final[:, :, 0])
