"""Learned cooperative perception: late, early and intermediate fusion of a network on lidar points."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product

from eidrive_reports.cooperative_perception.receivers import (
    ARMS,
    AXES,
    LEAST_EXISTENCE,
    SCAN_RATE,
    YAW_PER_POSITION,
    Condition,
    Study,
    on_axis,
)
from eidrive_reports.cooperative_perception.scores import OVERLAPS, RANGES, PerceptionRecord
from eidrive_reports.cooperative_perception.trial import FIRST_SAMPLE, SAMPLE_INTERVAL
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import (
    REASON,
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    Value,
    finite,
    number,
    plain,
    result_sections,
)
from eidrive_reports.reproduction.part import Case, Part
from eidrive_reports.reproduction.perception import SCENES, measured_cases, protocol
from eidrive_reports.reproduction.perception_shapes import SHAPE_COLUMNS, shapes
from eidrive_reports.reproduction.perception_tables import (
    arm_rows,
    arm_table,
    curve_rows,
    curve_table,
    data_sections,
    hidden_rows,
    hidden_table,
    pool,
    records,
    volume_rows,
    volume_table,
)
from eidrive_scenario.api.experiments import jackknife_interval

STUDY = Study(
    "learned",
    tuple(ARMS),
    (
        "none",
        "average",
        "covariance_intersection",
        "covariance_intersection, aligned",
        "early",
        "attention",
        "attention, aligned",
        "where2comm",
    ),
    ("pose error", "latency", "loss"),
    tuple(Condition(arm) for arm, one in ARMS.items() if one.cooperates),
    2,
)
"""All arms, in the ranges that the grid of the features covers: up to 50 m from the ego."""
DETECTORS = ("pillars",)


FEATURES = tuple(arm for arm, one in ARMS.items() if one.shares == "features")
LATE = ("covariance_intersection", "covariance_intersection, aligned", "average")
"""Arms with late fusion: of all scans by their covariances, and of single scans as in the literature."""
TARGETS = {0.0: 0.03, 0.4: 0.1}
"""Gain of intermediate over late fusion in AP 0.7 that the literature leads to expect, by pose error [m]."""


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return one run per scene, in which all arms measure the same frames."""
    return measured_cases(detectors, STUDY)


def setup(measured: Sequence[PerceptionRecord], seeds: int) -> tuple[str, ...]:
    """Return the paragraphs about runs and arms."""
    frames = sum(one.frames for one in measured)
    objects, hit, hidden = (
        sum(sum(getattr(one, name)[: STUDY.reach]) for one in measured) for name in ("objects", "hit", "hidden")
    )
    return (
        f"The {len(SCENES)} scenes of part `perception` with {seeds} seeds each. All stations have the detector "
        "`pillars` (docs/perception.md; 32 rings, 10,000 points per scan, range 100 m, "
        f"{SCAN_RATE:g} Hz, minimum score {LEAST_EXISTENCE:g}) without a tracker. Its features cover 51.2 m about the "
        f"lidar, so only objects and detections within {RANGES[STUDY.reach - 1]:g} m of the ego count. One frame is "
        f"measured every {SAMPLE_INTERVAL:g} s from {FIRST_SAMPLE:g} s on: {frames} frames with {objects} objects, of "
        f"which the lidar of any station hits {hit} and {hidden} are hidden to the ego.",
        "Runs, receivers and faults are those of part `perception`: all arms measure the same frames, and the error "
        f"of the heading is {YAW_PER_POSITION * 0.6:g}° per 0.6 m. Features of a station move with its assumed pose "
        "as its boxes do. Stations send a CPM with boxes and then their features in frames of at most 1,400 bytes; "
        "each frame is a message that is lost on its own.",
        "Arms. `none`, `average`, `covariance_intersection` and `early` as in part `perception`; points that a "
        "station receives have the intensity 1, as messages do not contain it. `max`, `attention` and `where2comm` "
        "fuse features; they filter objects of all scans as covariance intersection does, fuse boxes of others where "
        "their features are missing. Only arms with `aligned` correct poses of senders by shared objects. `attention` "
        "and `max` send all cells, `where2comm` the "
        "most confident 1 %, or the stated share; 8 bytes per cell and 2 for its place, with `codes` 1 byte and 2.",
    )


def gain_rows(measured: Sequence[PerceptionRecord]) -> Iterator[Row]:
    """Yield the gain of intermediate over late fusion in average precision, with jackknife intervals over the runs."""
    places = [(arm, "none", 0.0) for arm in FEATURES]
    compared = [arm for arm in STUDY.compared if arm in FEATURES]
    places += [(arm, axis, value) for axis in STUDY.axes for arm in compared for value in AXES[axis][2][1:]]
    without = [[*measured[:number], *measured[number + 1 :]] for number in range(len(measured))]
    for late, (arm, fault, value) in product(LATE, places):
        mine, other = (Condition(one) if fault == "none" else on_axis(one, fault, value) for one in (arm, late))
        row: dict[str, Value] = {"arm": arm, "over": late, "fault": fault, "value": value}
        for index, overlap in list(enumerate(OVERLAPS))[1:]:
            gain = _gain(measured, mine, other, index)
            low = high = math.nan
            if len(measured) > 1:
                interval = jackknife_interval(gain, [_gain(some, mine, other, index) for some in without])
                low, high = interval.low, interval.high
            key = round(100.0 * overlap)
            row |= {f"gain_{key}": gain, f"low_{key}": finite(low), f"high_{key}": finite(high)}
        yield row


def _gain(measured: Sequence[PerceptionRecord], mine: Condition, late: Condition, overlap: int) -> float:
    first, second = (pool(measured, STUDY, one).precision(overlap).value for one in (mine, late))
    return first - second


def _gain_column(overlap: float) -> Column:
    key = round(100.0 * overlap)
    fields = (f"gain_{key}", f"low_{key}", f"high_{key}")
    value, *ends = (f"{{{name}:{form}}}" for name, form in zip(fields, ("+.3f", "+.2f", "+.2f"), strict=True))
    return Column(f"gain in AP {overlap:g} (95 %)", f"{value} ({ends[0]} to {ends[1]})", fields)


GAIN_COLUMNS = (
    plain("arm", "arm"),
    plain("over", "over"),
    plain("fault", "fault"),
    plain("value", "value", "g"),
    *(_gain_column(overlap) for overlap in OVERLAPS[1:]),
)


def conclusions(arms: Sequence[Row], gains: Sequence[Row], volumes: Sequence[Row]) -> tuple[str, ...]:
    """Return the paragraphs about the measured values."""
    listed = [
        f"{row['arm']} {number(row, 'ap_30'):.3f}, {number(row, 'ap_50'):.3f} and {number(row, 'ap_70'):.3f}"
        for row in arms
    ]
    sizes = [f"{row['arm']} {1e3 * number(row, 'megabytes_per_second'):,.0f}" for row in volumes[1:]]
    return (
        f"Without faults, AP at 0.3, 0.5 and 0.7: {'; '.join(listed)}.",
        f"Bytes of all messages per second [kB]: {', '.join(sizes)}.",
        *(_target(gains, late, value) for late in LATE for value in TARGETS),
        *_departures({str(row["arm"]): number(row, "ap_70") for row in arms}, gains),
    )


def _target(gains: Sequence[Row], late: str, deviation: float) -> str:
    """Return whether intermediate fusion gains as much over late fusion as expected at a pose error [m]."""
    place = (late, "pose error" if deviation else "none", deviation)
    mine = [row for row in gains if (row["over"], row["fault"], row["value"]) == place and row["arm"] in STUDY.compared]
    texts = [f"{row['arm']} {_gain_column(0.7).text(row)}" for row in mine]
    reached = [str(row["arm"]) for row in mine if number(row, "gain_70") >= TARGETS[deviation]]
    where = f"at a pose error of {deviation:g} m" if deviation else "without faults"
    return (
        f"AP 0.7 of intermediate fusion less that of `{late}` {where}: {', '.join(texts)}. The expected gain of "
        f"{TARGETS[deviation]:+g} is reached by {', '.join(reached) or 'none of them'}."
    )


def _departures(ap_70: Mapping[str, float], gains: Sequence[Row]) -> Iterator[str]:
    """Yield results that differ from those of the literature, with likely reasons."""
    if ap_70["early"] < ap_70["covariance_intersection"]:
        yield (
            f"{REASON} (early fusion has an AP 0.7 of {ap_70['early']:.3f}, below late fusion): the network was "
            "trained on points of one station, received points lack intensity, and early fusion detects in single "
            "scans."
        )
    if ap_70["attention, codes"] < ap_70["attention"] - TARGETS[0.0]:
        yield (
            f"{REASON} (a code book lowers AP 0.7 of `attention` from {ap_70['attention']:.3f} to "
            f"{ap_70['attention, codes']:.3f}): 256 entries round the eight compressed numbers of a cell coarsely: "
            "objects are found, and their boxes are displaced and turned."
        )
    displaced = [row for row in gains if row["fault"] == "pose error" and row["over"] == LATE[0]]
    if any(number(row, "gain_70") < 0.0 for row in displaced):
        yield (
            f"{REASON} (with pose errors intermediate fusion without aligned poses is below `{LATE[0]}`): covariance "
            "intersection knows the covariance of the pose of a sender, keeps the accurate own box of an object that "
            "both see, and averages "
            "independent errors over the scans; features have no covariance, and displaced ones blur those of the ego."
        )


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: set-up, results without faults, gain over late fusion, shapes, curves and volume."""
    measured = records(episodes)
    curves, hidden = tuple(curve_rows(measured, STUDY)), tuple(hidden_rows(measured, STUDY))
    arms, volumes = tuple(arm_rows(measured, STUDY)), tuple(volume_rows(measured, STUDY))
    gains = tuple(gain_rows(measured))
    sections = (
        Section("Set-up", setup(measured, len({one.seed for one in episodes}))),
        Section("Protocol", protocol(STUDY)),
        *result_sections(conclusions(arms, gains, volumes), arm_table(arms, STUDY)),
        Section(
            "Gain over late fusion",
            ("Average precision of intermediate fusion less that of late fusion under the same fault.",),
            DataTable("learned_gains", GAIN_COLUMNS, gains),
        ),
        Section("Shapes of the curves", (), DataTable("learned_shapes", SHAPE_COLUMNS, shapes(STUDY, curves, volumes))),
        Section("Curves", ("Average precision over all ranges.",), curve_table(curves, STUDY)),
        Section("Objects hidden to the ego", ("Recall at the overlap 0.5.",), hidden_table(hidden, STUDY)),
        Section("Precision and volume", (), volume_table(volumes, STUDY)),
        *data_sections(curves, hidden, STUDY),
    )
    return PartReport(PART.title, sections)


PART = Part(
    "learned",
    "Learned cooperative perception",
    (
        "What does intermediate fusion of features gain over late and early fusion, and how much of it do pose errors, "
        "latency, lost frames and fewer bytes cost?"
    ),
    2,
    DETECTORS,
    DETECTORS,
    cases,
    report,
)
