"""Table of tracks: one estimate per station and object."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.detections import CLASSES, NOT_ESTIMATED
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate, Table, assigned_pairs, gated_pairs, ranges
from eidrive_scenario.fusion.prediction import (
    initiate_heading,
    predict,
    predict_heading,
    significant_turn_rate,
    update_heading,
)
from eidrive_scenario.perception.tracking.association import (
    detected,
    likelihood_ratio,
    make_plausible,
    squared_mahalanobis,
    survived,
)
from eidrive_scenario.perception.tracking.association import missed as after_miss
from eidrive_scenario.perception.tracking.motion_models import KNOWN_SPEED, UNKNOWN_SPEED
from eidrive_scenario.perception.tracking.uncertain_pose import pose_jacobian

TRACK = np.dtype(
    [
        ("receiver", "i8"),  # index of the receiving station in a batch
        ("station", "i8"),
        ("number", "i8"),  # object id of the station, -1 without one
        ("time", "f8"),  # time of the estimate [s]
        ("seen", "f8"),  # last detection by the station [s]
        ("mean", "f8", (4,)),  # x y vx vy [m, m/s]
        ("covariance", "f8", (4, 4)),
        ("pose", "f8", (2, 2)),  # of x y, caused by the pose covariance of the station [m²]
        ("vague", "?"),  # the covariance of the position is unknown
        ("moving", "?"),  # the velocity is known
        ("measured", "?"),  # the velocity is a measurement of one report, and not the state of a filter
        ("judged", "?"),  # the station tracks the object and reports its existence probability
        ("body", "f8", (4,)),  # z l w h [m]
        ("weight", "f8"),  # weight of the body: sum of scores
        ("heading", "f8", (2,)),  # yaw and its rate [rad, rad/s]
        ("heading_covariance", "f8", (3,)),  # yaw, cross term, rate
        ("facing", "f8"),  # votes for the front
        ("score", "f8"),
        ("existence", "f8"),  # existence probability
        ("votes", "f8", (len(CLASSES),)),
    ],
    align=True,  # otherwise numpy copies every unaligned number before an operation
)

MIN_EXISTENCE = 0.05
"""Minimum existence probability of a track; below, it is deleted, as by `delete_existence` of trackers."""
MAX_WEIGHT = 10.0
"""Maximum weight of earlier reports of the size, so that it can still change."""
MAX_LATERAL_ACCELERATION = 9.81
"""Maximum lateral acceleration of a turn [m/s²]: that of tires with a friction coefficient of 1."""
_ROW = np.dtype((np.void, TRACK.itemsize))
Rows = NDArray[np.void]
"""Rows of a table as bytes: numpy copies them at once, and those of a table field by field."""
_ROW_OF_CLASS = {name: row for row, name in enumerate(CLASSES)}
_MISC = _ROW_OF_CLASS["misc"]


def rows_of(tracks: Table) -> Rows:
    """Return the rows of a table as bytes, which share its memory."""
    return tracks.view(_ROW)


def initiate_tracks(receivers: Sequence[int], reports: Sequence[Report]) -> Table:
    """Return new tracks of the objects in reports, one row each, in order. The station is the index of its report.

    Boxes that are not finite or have no size are omitted. A message that several stations received is converted once.

    receivers  index of the receiving station of each report
    """
    contents: dict[tuple[int, int], int] = {}
    content = [contents.setdefault((id(report.detections), id(report.state)), len(contents)) for report in reports]
    if len(contents) < len(reports):
        tracks = _converted(list(dict(zip(content, reports, strict=True)).values()))
        starts, ends = (np.searchsorted(tracks["station"], content, side) for side in ("left", "right"))
        number, rows = ranges(starts, ends, np.arange(len(tracks)))
        tracks = tracks.take(rows)
        tracks["station"] = number
    else:
        tracks = _converted(reports)
    tracks["receiver"] = np.asarray(receivers)[tracks["station"]]
    return tracks


def _converted(reports: Sequence[Report]) -> Table:
    """Return one row for each usable object of these reports."""
    lists = [report.detections for report in reports]
    boxes = np.concatenate([detections.boxes for detections in lists])
    scores = np.concatenate([detections.scores for detections in lists])
    velocity = np.concatenate([detections.velocity for detections in lists])
    table = np.zeros(len(boxes), TRACK)
    counts = [len(detections) for detections in lists]
    covariance = table["covariance"]
    covariance[:, :2, :2] = np.concatenate([detections.covariance for detections in lists])
    table["vague"] = make_plausible(covariance)
    table["mean"][:, :2] = boxes[:, :2]
    table["body"] = boxes[:, 2:6]
    table["score"] = table["weight"] = table["existence"] = np.minimum(np.maximum(scores, 0.0), 1.0)
    if any([detections.existence is not NOT_ESTIMATED for detections in lists]):
        existence = np.concatenate([detections.confidence for detections in lists])
        table["existence"] = np.minimum(np.maximum(existence, 0.0), 1.0)
        table["judged"] = np.repeat([len(detections.existence) > 0 for detections in lists], counts)
    moving = np.isfinite(velocity[:, 0] + velocity[:, 1])
    table["moving"] = moving
    table["mean"][:, 2:] = np.where(moving[:, None], velocity, 0.0)
    table["measured"] = moving & np.repeat([detections.velocity_deviation is not None for detections in lists], counts)
    deviation = np.repeat([detections.velocity_deviation or KNOWN_SPEED for detections in lists], counts)
    variance = np.where(moving, deviation, UNKNOWN_SPEED) ** 2
    if any([len(detections.velocity_variance) for detections in lists]):
        estimated = np.repeat([len(detections.velocity_variance) > 0 for detections in lists], counts)
        stated = np.concatenate([detections.velocity_variance for detections in lists])
        variance[estimated] = np.maximum(variance[estimated], stated)
    covariance[:, 2, 2] = covariance[:, 3, 3] = variance
    table["heading"], table["heading_covariance"] = initiate_heading(boxes[:, 6])
    table["facing"] = 1.0
    table["station"] = np.repeat(np.arange(len(reports)), counts)
    table["time"] = table["seen"] = np.repeat([detections.time for detections in lists], counts)
    table["number"] = [number for detections in lists for number in detections.tracks or (-1,) * len(detections)]
    words = [_ROW_OF_CLASS.get(name, _MISC) for detections in lists for name in detections.classes]
    table["votes"][np.arange(len(table)), words] = table["score"]
    start = 0
    for report, count in zip(reports, counts, strict=True):
        rows = table[start : start + count]
        start += count
        if report.state is not None and report.state.pose_covariance is not None:
            rows["pose"] = pose_part(rows["mean"][:, :2], report.state.x, report.state.y, report.state.pose_covariance)
    if not len(boxes) or (math.isfinite(boxes.sum() + scores.sum()) and boxes[:, 3:6].min() > 0.0):
        return table
    usable: Table = table[np.isfinite(boxes).all(axis=1) & (boxes[:, 3:6] > 0.0).all(axis=1) & np.isfinite(scores)]
    return usable


def pose_part(points: Array, x: float, y: float, covariance: Array) -> Array:
    """Return the covariance (N, 2, 2) of measured points (N, 2) caused by the pose covariance (3, 3) of a station.

    The pose is x, y, yaw at (x, y). The result is J P Jᵀ.
    """
    jacobian = pose_jacobian(points, x, y)
    return np.asarray(jacobian @ covariance @ np.swapaxes(jacobian, 1, 2))


def predict_tracks(tracks: Table, time: Array) -> None:
    """Predict the tracks to `time` (N,) [s].

    The tracks of one receiving station are predicted by the same formula, and independent of other receiving stations.
    """
    step = time - tracks["time"]
    moved = _of_receivers_with(step != 0.0, tracks["receiver"])
    if not moved.all():
        rows = np.flatnonzero(moved)
        if len(rows):
            part = tracks.take(rows)
            predict_tracks(part, time[rows])
            rows_of(tracks)[rows] = rows_of(part)
        return
    mean, covariance, heading, of_heading = (
        tracks[name] for name in ("mean", "covariance", "heading", "heading_covariance")
    )
    turn = significant_turn_rate(heading, of_heading)
    # A faster turn than tires allow is one of boxes only: of axes that jump, or that turn by half a circle per report.
    impossible = np.abs(turn) * np.hypot(mean[:, 2], mean[:, 3]) > MAX_LATERAL_ACCELERATION
    heading[impossible, 1] = turn[impossible] = 0.0
    turning = _of_receivers_with(turn != 0.0, tracks["receiver"])
    mean[:], covariance[:] = predict(mean, covariance, step, turn, turning)
    heading[:], of_heading[:] = predict_heading(heading, of_heading, step)
    tracks["existence"] = survived(tracks["existence"], step)
    tracks["time"] = time


def _of_receivers_with(marked: NDArray[np.bool_], receivers: Integers) -> NDArray[np.bool_]:
    """Return whether each row belongs to a receiving station with a marked row."""
    count = np.count_nonzero(marked)
    if count in (0, len(marked)):
        return marked
    has_marked = np.zeros(int(receivers.max()) + 1, dtype=bool)
    has_marked[receivers[marked]] = True
    return has_marked[receivers]


def update_tracks(
    tracks: Table, receivers: Sequence[int], reports: Sequence[Report], gate: AssociationGate, max_age: float
) -> Table:
    """Return the tracks of several stations after one report of each, sorted by station; `tracks` is changed.

    Tracks that the station did not detect for `max_age` seconds are deleted. Velocities of a filter, and exact ones,
    replace the state: filtering it again would count its past twice. Positions without velocities, and velocities with
    a `velocity_deviation`, are measurements of a Kalman filter.

    tracks     with the index of the report of its station as station
    receivers  index of the receiving station of each report
    """
    born = initiate_tracks(receivers, reports)
    if not len(tracks):
        return born
    times = np.array([report.detections.time for report in reports])[tracks["station"]]
    recent = times - tracks["seen"] <= max_age + TIME_TOLERANCE
    if not recent.all():
        tracks, times = tracks.take(np.flatnonzero(recent)), times[recent]
    predict_tracks(tracks, times)
    for station, report in enumerate(reports):
        if report.pose_change is not None and report.state is not None:
            changed = np.flatnonzero(tracks["station"] == station)
            part = pose_part(tracks["mean"][changed, :2], report.state.x, report.state.y, report.pose_change)
            tracks["covariance"][changed, :2, :2] += part
    pairs = assigned_pairs(gated_pairs(tracks, born, gate, same_station=True))
    rows = np.array([row for row, _ in pairs], dtype=np.intp)
    columns = np.array([column for _, column in pairs], dtype=np.intp)
    if len(rows) == len(tracks):
        tracks = _update(tracks, born.take(columns[np.argsort(rows)]))
    else:
        rows_of(tracks)[rows] = rows_of(_update(tracks.take(rows), born.take(columns)))
        missed = np.ones(len(tracks), dtype=bool)
        missed[rows] = False
        _coast(tracks, missed, reports)
    if tracks["existence"].min(initial=1.0) < MIN_EXISTENCE:
        tracks = tracks.take(np.flatnonzero(tracks["existence"] >= MIN_EXISTENCE))
    if len(columns) == len(born):
        return tracks
    fresh = np.ones(len(born), dtype=bool)
    fresh[columns] = False
    both = np.concatenate([rows_of(tracks), rows_of(born.take(np.flatnonzero(fresh)))]).view(TRACK)
    return both.take(np.argsort(both["station"], kind="stable"))


def _update(old: Table, new: Table) -> Table:
    """Update predicted tracks with the boxes `new` of a report; return `new` with the updated state."""
    after = new
    still, measured = ~new["moving"], new["measured"]
    filtered = still | measured
    if filtered.any():
        # The existence probability of a tracking station includes its past; other reports are independent.
        given, before = new[filtered], old[filtered]
        spread = before["covariance"][:, :2, :2] + given["covariance"][:, :2, :2]
        squared, determinant = squared_mahalanobis(given["mean"][:, :2] - before["mean"][:, :2], spread)
        existence = detected(before["existence"], likelihood_ratio(squared, determinant, given["score"]))
        after["existence"][filtered] = np.where(given["judged"], given["existence"], existence)
        after["moving"][still] = True
    for rows, size in ((still, 2), (measured, 4)):
        if rows.any():
            after["mean"][rows], after["covariance"][rows] = _kalman_update(old[rows], new[rows], size)
    after["heading"], after["heading_covariance"], after["facing"] = update_heading(
        old["heading"], old["heading_covariance"], old["facing"], new["heading"][:, 0]
    )
    weight = np.minimum(old["weight"], MAX_WEIGHT)
    total = weight + new["weight"]
    share = np.divide(new["weight"], total, out=np.zeros(len(total)), where=total > 0.0)
    after["body"] = old["body"] + share[:, None] * (new["body"] - old["body"])
    after["weight"] = total
    after["votes"] = old["votes"] + new["votes"]
    return after


def _kalman_update(old: Table, new: Table, size: int) -> tuple[Array, Array]:
    """Return state and covariance after a Kalman update by the first `size` components of `new`, in Joseph form."""
    covariance, noise = old["covariance"], new["covariance"][:, :size, :size]
    gain = covariance[:, :, :size] @ np.linalg.inv(covariance[:, :size, :size] + noise)
    innovation = new["mean"][:, :size] - old["mean"][:, :size]
    rest = np.broadcast_to(np.eye(4), covariance.shape).copy()
    rest[:, :, :size] -= gain
    after = rest @ covariance @ np.swapaxes(rest, 1, 2) + gain @ noise @ np.swapaxes(gain, 1, 2)
    return old["mean"] + (gain @ innovation[:, :, None])[:, :, 0], after


def _coast(tracks: Table, missed: NDArray[np.bool_], reports: Sequence[Report]) -> None:
    """Reduce the existence probability of tracks after a missed detection; delete those of tracking stations.

    Tracks of stations with incomplete reports are unchanged.
    """
    complete = np.array([report.complete for report in reports])
    rows = np.flatnonzero(missed & complete[tracks["station"]])
    before = np.minimum(tracks["existence"][rows], 0.999)
    after = np.where(tracks["number"][rows] >= 0, 0.0, after_miss(before))
    tracks["existence"][rows] = after
    tracks["score"][rows] *= np.divide(after, before, out=np.zeros(len(rows)), where=before > 0.0)
