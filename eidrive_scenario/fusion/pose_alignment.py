"""Alignment of the pose of another station by objects that it and the receiver report.

The errors of the poses that two stations assume move all objects of one of them together, relative to those of the
other. Objects that both report therefore show the error (Lu et al., Robust collaborative 3D object detection in
presence of pose errors, ICRA 2023, with a pose graph of all stations). Here each sender is aligned alone, to objects of
stations with an exact pose: its error e = (x, y, yaw) relative to the receiver maximizes

    N(e; 0, P) · Π N(z - h(x, e); 0, C)

over the pairs of objects z of the sender and x of the receiver, with the covariance P that the sender states (plus that
of the receiver, see `relative_state`). By this prior two objects do not worsen the yaw, and an exact pose stays as it
is. Which objects are the same is not known: pairs are assigned within gates of all covariances for several hypotheses
of e, and an error is only corrected if its hypothesis is much more probable than all others, among them that no object
is common. So a row of cars in equal distances is not shifted by one car.

Fusion of boxes uses `PoseAligner`, fusion of feature maps the corrected pose of a sender by `align_pose`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.assignment import assign
from eidrive_scenario.base.detections import CLASSES, VULNERABLE, Detections
from eidrive_scenario.base.geometry import on_two_levels, rotation, wrap_angle
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate, Table
from eidrive_scenario.fusion.report_history import ReportHistory
from eidrive_scenario.fusion.tracks import TRACK, initiate_tracks, predict_tracks
from eidrive_scenario.perception.tracking.association import UNASSIGNED_GATE, squared_mahalanobis
from eidrive_scenario.perception.tracking.uncertain_pose import pose_covariance_at, pose_jacobian
from eidrive_scenario.v2x.messages.message import StationState

OBJECT_DENSITY = 0.02
"""Density of objects that only one of two stations reports [1/m²]: one in 15 m of a lane of 3.5 m."""
VIEW_DEVIATION = 0.25
"""Standard deviation per axis that is added to the offset of two boxes of one object [m].

Stations see different sides of an object, and complete the others. The covariances that the detector `lidar` states do
not contain this: its boxes of one object are 0.38 m apart where 0.22 m are expected (medians, scenarios 3 to 5). The
squared errors of corrected poses are then 1.2 times their covariance (median), and 3.5 times without this addition.
"""
MIN_PROBABILITY = 0.95
"""Minimum probability of the hypothesis by which a pose is corrected."""
MAX_EVIDENCE = 3
"""Number of pairs to which the likelihood of more pairs is tempered. Stations see different parts of a row of equal
cars: each car without a partner says little against a hypothesis, or both parts would be moved onto each other."""
MAX_SEEDS = 100
"""Maximum number of pairs with which hypotheses begin."""
MAX_HYPOTHESES = 6
"""Maximum number of hypotheses that are refined and compared; more have a small probability."""
NEGLIGIBLE = 8.0
"""Difference of the logarithms of odds from which a hypothesis is not compared."""
_GATE = AssociationGate.of(0.99, 0.0).chi_square
_HEADING_GATE = 3.0
"""Maximum difference of two axes [standard deviations]; boxes of a few points may lie across their object."""
_MAX_ITERATIONS = 10
_MAX_COORDINATE = 1e7
"""Maximum coordinate and deviation of what is aligned [m], which rounding would affect beyond."""
_CONVERGED = 1e-9
"""Change of the error below which it is not computed again [standard deviations of the prior]."""
_VULNERABLE = np.array([name in VULNERABLE for name in CLASSES])


@dataclass(frozen=True)
class PoseAlignment:
    """Pose of a station, corrected by shared objects.

    pose        corrected x, y [m] and yaw [rad]
    error       (3,) estimated error of the assumed pose, which is `pose` plus `error`; 0 without a correction
    covariance  (3, 3) of the corrected pose; that of the assumed pose without a correction
    shared      number of shared objects; 0 without a correction
    """

    pose: tuple[float, float, float]
    error: Array
    covariance: Array
    shared: int

    @property
    def is_corrected(self) -> bool:
        """Whether shared objects determine the pose."""
        return self.shared > 0


def align_pose(own: Detections, report: Report) -> PoseAlignment:
    """Return the pose of the sender of a report, corrected by objects that the own detections contain, too.

    Own detections are predicted to the time of the report. The pose stays if the report has no pose covariance, which
    states that it is exact. Raise ValueError if the report has no state.
    """
    if report.state is None:
        raise ValueError(f"the report of {report.station!r} has no state")
    tracks = initiate_tracks([0], [Report("", own, own.time)])
    return align(tracks, initiate_tracks([0], [report]), report.state)


def align(own: Table, other: Table, state: StationState) -> PoseAlignment:
    """Return the corrected pose of a station.

    own    objects of stations with exact poses, which are predicted to the time of the others
    other  objects of the station at one time, as `initiate_tracks` returns them
    state  its state, with the covariance of its pose relative to that of the receiver
    """
    prior = np.zeros((3, 3)) if state.pose_covariance is None else state.pose_covariance
    best = None
    values = np.array([state.x, state.y, *np.sqrt(np.abs(prior)).ravel()])
    if prior.any() and (np.abs(values) <= _MAX_COORDINATE).all():
        own, other = (table[(np.abs(table["mean"]) <= _MAX_COORDINATE).all(axis=1)] for table in (own, other))
        if len(own) and len(other):
            predict_tracks(own, np.full(len(own), other["time"][0]))
            best = _likeliest(_Candidates.of(own, other, state.x, state.y, prior))
    if best is None:
        return PoseAlignment((state.x, state.y, state.yaw), np.zeros(3), prior, 0)
    x, y, yaw = best.error.tolist()
    pose = state.x - x, state.y - y, float(wrap_angle(state.yaw - yaw))
    return PoseAlignment(pose, best.error, best.covariance, len(best.pairs))


def aligned_report(report: Report, alignment: PoseAlignment) -> Report:
    """Return a report with its objects and its state at the corrected pose."""
    state, detections = report.state, report.detections
    if state is None or not alignment.is_corrected:
        return report
    x, y, yaw = alignment.pose
    return replace(
        report,
        detections=detections.move(np.array([state.x, state.y]), np.array([x, y]), -float(alignment.error[2])),
        state=replace(state, x=x, y=y, yaw=yaw, pose_covariance=alignment.covariance),
    )


class _Aligned(NamedTuple):
    """Newest report of a station with its alignment, and that of the report before.

    own_change  covariance (3, 3) of all changes of the own pose error up to the alignment
    """

    report: Report
    alignment: PoseAlignment
    own_change: Array
    before: _Aligned | None


class PoseAligner:
    """Alignment of the reports that a station receives, before its history filters them.

    The own tracks, and those of other stations with exact poses, are the reference. All reports are aligned one by
    one: how fast the pose error of a sender changes is not known. If the own pose error changes, the newest report of
    each station is aligned again. The history gets the covariance of the change between two aligned reports, that of
    independent errors at most, so that it does not take a correction for a motion of all objects.
    """

    def __init__(self, history: ReportHistory) -> None:
        self._history = history
        self._references: dict[str, None] = {}
        self._new: list[Report] = []
        self._aligned: dict[str, _Aligned] = {}
        self._own_change = np.zeros((3, 3))
        """Covariance of all changes of the own pose error."""
        self._own_position = 0.0, 0.0
        self._own_pose_changed = False

    def add_report(self, report: Report) -> None:
        """Store a report until the next `align`, or pass it on if its station has an exact pose."""
        if report.state is not None and report.state.pose_covariance is not None:
            self._new.append(report)
            return
        self._history.add_report(report)
        self._references[report.station] = None
        if report.state is not None and report.pose_change is not None:
            self._own_change = self._own_change + report.pose_change
            self._own_position = report.state.x, report.state.y
            self._own_pose_changed = True

    def align(self, now: float) -> None:
        """Pass the stored reports on, aligned to the tracks at `now` [s]. The history has processed all others."""
        span = self._history.span
        due = sorted(self._new, key=lambda report: report.detections.time)
        self._new = []
        if self._own_pose_changed:
            renewed = {report.station for report in due}
            due += [held.report for station, held in self._aligned.items() if station not in renewed]
            self._own_pose_changed = False
        if not due:
            return
        tracks = self._history.tracks(tuple(self._references)).view(TRACK)
        tracks = tracks[now - tracks["seen"] <= span + TIME_TOLERANCE]
        for report in due:
            if now - report.detections.time <= span + TIME_TOLERANCE:
                self._pass_on(report, tracks)
            else:
                self._aligned.pop(report.station, None)
                self._history.add_report(report)

    def _pass_on(self, report: Report, tracks: Table) -> None:
        """Align a report to these tracks, and pass it on."""
        state = report.state
        assert state is not None
        alignment = align(tracks, initiate_tracks([0], [report]), state)
        last = self._aligned.get(report.station)
        again = last is not None and last.report is report
        before = last.before if last is not None and again else last
        if last is None or report.detections.time >= last.report.detections.time:
            kept = None if before is None else before._replace(before=None)
            self._aligned[report.station] = _Aligned(report, alignment, self._own_change, kept)
        if again and last is not None and not (alignment.is_corrected or last.alignment.is_corrected):
            return
        aligned = aligned_report(report, alignment)
        if before is not None and (alignment.is_corrected or before.alignment.is_corrected):
            dx, dy = state.x - self._own_position[0], state.y - self._own_position[1]
            own = pose_covariance_at(dx, dy, self._own_change - before.own_change)
            aligned = replace(aligned, pose_change=before.alignment.covariance + alignment.covariance + own)
        self._history.add_report(aligned)


class _Candidates(NamedTuple):
    """Candidate pairs (K,) of objects of two stations, and the prior of the pose error.

    rows, columns   object of the sender, in order, and of the receiver
    lever           (K, 2) vector from the assumed position of the sender to its object [m]
    offset          (K, 2) position of the object of the sender minus that of the receiver [m]
    covariance      (K, 2, 2) of the offset without the pose error, with that of different views
    turn, turn_variance  (K,) difference of the axes of the boxes [rad], and its variance
    prior, root     (3, 3) covariance of the pose error, and a root of it
    """

    rows: Integers
    columns: Integers
    lever: Array
    offset: Array
    covariance: Array
    turn: Array
    turn_variance: Array
    prior: Array
    root: Array

    @classmethod
    def of(cls, own: Table, other: Table, x: float, y: float, prior: Array) -> _Candidates:
        """Return the pairs within the gate of all covariances, on one level and of one group of classes."""
        values, vectors = np.linalg.eigh(0.5 * (prior + prior.T))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        prior = root @ root.T
        jacobian = pose_jacobian(other["mean"][:, :2], x, y) @ root
        view = VIEW_DEVIATION**2 * np.eye(2)
        spread = other["covariance"][:, None, :2, :2] + own["covariance"][:, :2, :2] + own["pose"] + view
        offset = other["mean"][:, None, :2] - own["mean"][:, :2]
        whole = spread + (jacobian @ np.swapaxes(jacobian, 1, 2))[:, None]
        body, own_body = other["body"][:, None], own["body"]  # z, length, width, height
        apart = on_two_levels(body[..., 0], body[..., 3], own_body[:, 0], own_body[:, 3])
        group, own_group = (_VULNERABLE[np.argmax(table["votes"], axis=1)] for table in (other, own))
        rows, columns = np.nonzero(
            (squared_mahalanobis(offset, whole)[0] <= UNASSIGNED_GATE) & ~apart & (group[:, None] == own_group)
        )
        turn = other["heading"][rows, 0] - own["heading"][columns, 0]
        return cls(
            rows,
            columns,
            other["mean"][rows, :2] - (x, y),
            offset[rows, columns],
            spread[rows, columns],
            (turn + 0.5 * math.pi) % math.pi - 0.5 * math.pi,
            other["heading_covariance"][rows, 0] + own["heading_covariance"][columns, 0],
            prior,
            root,
        )


class _Hypothesis(NamedTuple):
    """Pose error (3,) with its covariance (3, 3), its pairs, and the logarithm of its odds against no common object."""

    error: Array
    covariance: Array
    pairs: Integers
    log_odds: float


def _likeliest(candidates: _Candidates) -> _Hypothesis | None:
    """Return the likeliest hypothesis, or None if it is not probable enough."""
    if not len(candidates.rows):
        return None
    seeds = np.unique(np.linspace(0, len(candidates.rows) - 1, MAX_SEEDS).astype(int))
    errors, covariances, scores, tempered = _seeded(candidates, seeds)
    hypotheses: list[_Hypothesis] = []
    refined = 0
    for seed in np.argsort(-scores, kind="stable").tolist():
        pair = seeds[seed : seed + 1]
        if tempered[seed] < tempered.max() - NEGLIGIBLE or any(
            _fits(candidates, pair, other.error, other.covariance)[0] for other in hypotheses
        ):
            continue
        hypothesis = _refine(candidates, errors[seed], covariances[seed])
        if hypothesis is not None and not any(_are_same(hypothesis, other) for other in hypotheses):
            hypotheses.append(hypothesis)
        refined += 1
        if refined == MAX_HYPOTHESES:
            break
    hypotheses.sort(key=lambda hypothesis: -hypothesis.log_odds)
    if not hypotheses:
        return None
    odds = np.array([0.0, *(hypothesis.log_odds for hypothesis in hypotheses)])
    probability = 1.0 / np.exp(odds - hypotheses[0].log_odds).sum()
    return hypotheses[0] if probability >= MIN_PROBABILITY else None


def _seeded(candidates: _Candidates, seeds: Integers) -> tuple[Array, Array, Array, Array]:
    """Return the pose errors (S, 3) that single pairs show, their covariances (S, 3, 3), and their log odds (S,).

    The log odds add those of the best pair of each other object of the sender. The last result adds the best of them
    only, up to MAX_EVIDENCE pairs.
    """
    jacobian = pose_jacobian(candidates.lever, 0.0, 0.0)
    own = jacobian[seeds]
    cross = candidates.prior @ np.swapaxes(own, 1, 2)
    innovation = candidates.covariance[seeds] + own @ cross
    gain = cross @ np.linalg.inv(innovation)
    errors = (gain @ candidates.offset[seeds, :, None])[:, :, 0]
    covariances = candidates.prior - gain @ np.swapaxes(cross, 1, 2)
    gains = _log_odds(candidates.offset[seeds], innovation)
    # The covariance J P Jᵀ by its entries, as the pairs of all seeds with all others are many.
    p = covariances[:, :, :, None]
    a, b = jacobian[:, 0, 2], jacobian[:, 1, 2]
    xx = candidates.covariance[:, 0, 0] + p[:, 0, 0] + a * (2.0 * p[:, 0, 2] + a * p[:, 2, 2])
    xy = candidates.covariance[:, 0, 1] + p[:, 0, 1] + a * p[:, 1, 2] + b * (p[:, 0, 2] + a * p[:, 2, 2])
    yy = candidates.covariance[:, 1, 1] + p[:, 1, 1] + b * (2.0 * p[:, 1, 2] + b * p[:, 2, 2])
    x = candidates.offset[:, 0] - errors[:, :1] - a * errors[:, 2:]
    y = candidates.offset[:, 1] - errors[:, 1:2] - b * errors[:, 2:]
    determinant = xx * yy - xy * xy
    distance = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant
    odds = np.where(distance <= _GATE, -0.5 * (distance + np.log(determinant)) + _CONSTANT, 0.0)
    starts = np.flatnonzero(np.diff(candidates.rows, prepend=-1))
    best = np.maximum(np.maximum.reduceat(odds, starts, axis=1), 0.0)
    object_of = np.searchsorted(starts, seeds, "right") - 1
    best[np.arange(len(seeds)), object_of] = gains
    tempered = np.sort(best, axis=1)[:, -MAX_EVIDENCE:].sum(axis=1)
    return errors, covariances, best.sum(axis=1), tempered


def _refine(candidates: _Candidates, error: Array, covariance: Array) -> _Hypothesis | None:
    """Return the hypothesis that begins with an error (3,) and its covariance (3, 3): pairs are assigned, and the error
    is estimated, until both are constant. None without a pair."""
    pairs: Integers | None = None
    log_odds = 0.0
    for _ in range(_MAX_ITERATIONS):
        inside = np.flatnonzero(_fits(candidates, np.arange(len(candidates.rows)), error, covariance))
        offset, jacobian = _moved(candidates, inside, error)
        odds = _log_odds(offset, candidates.covariance[inside] + jacobian @ covariance @ np.swapaxes(jacobian, 1, 2))
        rows, columns = candidates.rows[inside].tolist(), candidates.columns[inside].tolist()
        number = dict(zip(zip(rows, columns, strict=True), inside.tolist(), strict=True))
        assigned = assign(rows, columns, (-odds).tolist())
        chosen = np.array(sorted(number[pair] for pair in assigned), dtype=np.int64)
        if not len(chosen):
            return None
        if pairs is not None and np.array_equal(chosen, pairs):
            break
        pairs = chosen
        error, covariance, log_odds = estimate_error(candidates, pairs)
    assert pairs is not None
    # An inconsistent pair attracts the estimate that it is compared with: the others alone are the better measure. The
    # residual of a pair in the estimate has the covariance C - J P Jᵀ, which gives the same distance. The worse half of
    # these pairs is removed at a time.
    while len(pairs) > 2:
        offset, jacobian = _moved(candidates, pairs, error)
        rest = candidates.covariance[pairs] - jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
        distance = squared_mahalanobis(offset, rest)[0]
        count = np.count_nonzero(distance > _GATE)
        if not count:
            break
        pairs = np.sort(pairs[np.argsort(distance, kind="stable")[: len(pairs) - (count + 1) // 2]])
        error, covariance, log_odds = estimate_error(candidates, pairs)
    return _Hypothesis(error, covariance, pairs, log_odds)


def estimate_error(candidates: _Candidates, pairs: Integers) -> tuple[Array, Array, float]:
    """Return the most probable pose error (3,), its covariance (3, 3), and the logarithm of the odds of these pairs.

    Gauss-Newton method over u, of which the error L u has the covariance L Lᵀ of the prior. The covariance is L H⁻¹ Lᵀ
    with the Hessian H, and the odds are those of Laplace's approximation, exact for a linear h.
    """
    root, weight = candidates.root, np.linalg.inv(candidates.covariance[pairs])
    turn_weight = np.where(
        np.abs(candidates.turn[pairs])
        <= _HEADING_GATE * np.sqrt(candidates.turn_variance[pairs] + candidates.prior[2, 2]),
        1.0 / candidates.turn_variance[pairs],
        0.0,
    )
    scaled, error = np.zeros(3), np.zeros(3)
    for _ in range(_MAX_ITERATIONS):
        offset, jacobian = _moved(candidates, pairs, error)
        sensitivity = jacobian @ root
        weighted = np.swapaxes(sensitivity, 1, 2) @ weight
        turn = candidates.turn[pairs] - error[2]
        hessian = np.eye(3) + (weighted @ sensitivity).sum(axis=0) + turn_weight.sum() * np.outer(root[2], root[2])
        slope = (weighted @ offset[:, :, None])[:, :, 0].sum(axis=0) + (turn_weight @ turn) * root[2] - scaled
        step = np.linalg.solve(hessian, slope)
        scaled = scaled + step
        error = root @ scaled
        if np.abs(step).max() < _CONVERGED:
            break
    offset, _ = _moved(candidates, pairs, error)
    turn = candidates.turn[pairs] - error[2]
    share = min(1.0, MAX_EVIDENCE / len(pairs))
    data = _log_odds(offset, candidates.covariance[pairs]).sum() - 0.5 * turn_weight @ (turn * turn)
    volume = np.linalg.slogdet(np.eye(3) + share * (hessian - np.eye(3)))[1]
    odds = share * data - 0.5 * (scaled @ scaled + volume)
    return error, root @ np.linalg.inv(hessian) @ root.T, float(odds)


_CONSTANT = -math.log(2.0 * math.pi * OBJECT_DENSITY)


def _log_odds(offset: Array, covariance: Array) -> Array:
    """Return the logarithms (K,) of the densities of offsets (K, 2) over that of other objects."""
    distance, determinant = squared_mahalanobis(offset, covariance)
    return np.asarray(_CONSTANT - 0.5 * (distance + np.log(determinant)))


def _moved(candidates: _Candidates, pairs: Integers, error: Array) -> tuple[Array, Array]:
    """Return the offsets (K, 2) of pairs after the correction of an error (3,), and their derivatives (K, 2, 3)."""
    lever = candidates.lever[pairs]
    turned = lever @ rotation(error[2])
    return candidates.offset[pairs] + turned - lever - error[:2], pose_jacobian(turned, 0.0, 0.0)


def _fits(candidates: _Candidates, pairs: Integers, error: Array, covariance: Array) -> Array:
    """Return whether each pair is within the gate for this error (3,) with its covariance (3, 3)."""
    offset, jacobian = _moved(candidates, pairs, error)
    spread = candidates.covariance[pairs] + jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
    return np.asarray(squared_mahalanobis(offset, spread)[0] <= _GATE)


def _are_same(first: _Hypothesis, second: _Hypothesis) -> bool:
    """Return whether the errors of two hypotheses agree."""
    offset = first.error - second.error
    spread = first.covariance + second.covariance
    return bool(offset @ np.linalg.pinv(spread, hermitian=True) @ offset <= _GATE)
