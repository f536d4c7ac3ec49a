"""Cooperative perception as its field reports it: average precision over pose error, latency, loss and volume."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

from eidrive_reports.cooperative_perception.receivers import (
    AXES,
    DRIFT_TIME,
    LEAST_EXISTENCE,
    POSE_AND_LATENCY,
    SCAN_RATE,
    YAW_PER_POSITION,
    Condition,
    Study,
)
from eidrive_reports.cooperative_perception.scores import RANGES
from eidrive_reports.cooperative_perception.trial import FIRST_SAMPLE, SAMPLE_INTERVAL
from eidrive_reports.reproduction import pose_errors
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import REASON, PartReport, Row, Section, number, result_sections, where
from eidrive_reports.reproduction.part import Case, Part
from eidrive_reports.reproduction.perception_shapes import crossing, shape_section
from eidrive_reports.reproduction.perception_tables import StudyResult, records
from eidrive_scenario.api.run import RunSettings

SENDING = ("average", "covariance_intersection", "covariance_intersection, aligned", "early")
STUDY = Study(
    "perception",
    ("none", "none, filtered", *SENDING),
    ("none", *SENDING),
    tuple(AXES),
    (*(Condition(arm, every=scans) for arm in SENDING for scans in (1, 2, 5)), Condition("early", cell=0.2)),
    len(RANGES),
)


def setup(result: StudyResult, seeds: int) -> tuple[str, ...]:
    """Return the paragraphs about runs and arms."""
    frames, objects, hit, hidden = result.object_counts
    return (
        f"{len(SCENES)} scenes of the library with {seeds} seeds each: scenario 3 (parked ego, one vehicle sends), 4 "
        "(parked ego, three roadside units), 5 and 7 (ego turns at a crossing, a vehicle and one or two roadside "
        "units). All stations have the detector `lidar` (32 rings, 10,000 points per scan, range 100 m, "
        f"{SCAN_RATE:g} Hz) without a tracker. One frame is measured every {SAMPLE_INTERVAL:g} s from "
        f"{FIRST_SAMPLE:g} s on: {frames} frames with {objects} objects. The lidar of any station hits {hit} of "
        f"them; {hidden} are hidden: not hit by the lidar of the ego, but by that of another station.",
        "Each run is in closed loop by the rule of its scene. All arms measure the same frames: for each arm and "
        "fault, further agents of the ego and of the senders get the sensor readings of the run and exchange "
        "messages over a separate channel. They do not steer. So arms differ by fusion and messages only, not "
        "by traffic.",
        "Arms. `none`: detections of the last scan of the ego. `average`: boxes as measured, the rule of EI-Drive. "
        "`covariance_intersection`: boxes of all scans, filtered and predicted to the current time; `aligned` corrects "
        "the poses of the senders by objects that the ego detects, too (`align_poses`). `early`: points "
        "of all stations, one scan at a time. `none, filtered` is the filter of covariance intersection on own "
        "detections only, which separates its effect from that of messages.",
        f"Faults. Pose error: normal, standard deviation on x and on y each, and {YAW_PER_POSITION * 0.6:g}° per 0.6 "
        "m on the heading; drawn for each station and scan, the ego included, so that the relative error is larger "
        "by a factor of √2. OpenCOOD draws one vector for all frames, and CoAlign draws as here. Pose drift: the "
        f"same deviations, with a correlation time of {DRIFT_TIME:g} s as of GNSS. Senders state the covariance of "
        "their poses. Latency: constant. Loss: whole messages, independent. Scans are simultaneous, so messages "
        "without latency are of the same scan.",
    )


def protocol(study: Study) -> tuple[str, ...]:
    """Return the paragraphs about the evaluation."""
    return (
        "Truth: all road users present at the current time with a center within "
        f"{RANGES[study.reach - 1]:g} m of that of the "
        "ego, seen or not. The ego is no object, and receivers remove its body from received boxes and points. "
        "Sending vehicles are objects as all others; masts of roadside units are not. A detection on a mast is "
        "wrong. Farther objects and detections are ignored. Second number: objects with at least one lidar point of "
        "any station, as in OPV2V.",
        "A detection is correct if its intersection over union with a free object in plan view is at least 0.3, 0.5 "
        "or 0.7; detections choose in order of their score within a frame. Classes are not compared. Boxes are "
        "compared relative to the ego: the error of this pose does not affect own detections.",
        "Average precision is the area under precision over recall at all points, with the maximum precision at or "
        "above each recall (PASCAL VOC 2010). Detections of all frames are sorted by score (global sort), and those "
        "of one score enter together, as in KITTI's evaluation. OPV2V's "
        "papers keep the order of the frames (local sort), which is the second number. A correct detection counts "
        "in the range of its object, a wrong one in its own range. Scores are existence probabilities where they "
        f"are estimated; the least is {LEAST_EXISTENCE:g}. Intervals are 95 % jackknife intervals over the runs "
        "(Student's t of the pseudo-values).",
        "Hidden objects: no lidar point of the ego is on the body, and at least one of another station is. Volume: "
        "bytes of all sent messages per second, as encoded, from the link statistics.",
    )


def conclusions(result: StudyResult) -> tuple[str, ...]:
    """Return the paragraphs about the measured values."""
    by_arm = {row["arm"]: row for row in result.arms}
    listed = [f"{name} {row['ap_30']:.3f}, {row['ap_50']:.3f} and {row['ap_70']:.3f}" for name, row in by_arm.items()]
    hidden = [f"{name} {number(row, 'hidden_50'):.0%}" for name, row in by_arm.items()]
    return (
        f"Without faults, AP at 0.3, 0.5 and 0.7: {'; '.join(listed)}.",
        f"Hidden objects that are found at 0.5: {', '.join(hidden)}.",
        *(_limits(result.curves, axis) for axis in AXES if axis != POSE_AND_LATENCY),
        _volume(result.volumes),
        _sorting(result.arms),
        *_departures(by_arm),
    )


def _limits(curves: Sequence[Row], axis: str) -> str:
    """Return at which value of an axis the arms fall below no fusion."""
    texts = []
    for arm in SENDING:
        ends = []
        for overlap in (0.5, 0.7):
            shown = where(curves, axis=axis, range="all", iou=overlap)
            mine, alone = (
                {row["value"]: number(row, "ap") for row in where(shown, arm=name)} for name in (arm, "none")
            )
            at = crossing(mine, alone[0.0])
            ends.append("nowhere" if at is None else f"from {at:.2f}")
        texts.append(f"`{arm}` {ends[0]} and {ends[1]}")
    unit = {"latency": " [s]", "loss": ""}.get(axis, " [m]")
    return f"Below no fusion in AP 0.5 and AP 0.7 over {axis}{unit}, interpolated: {'; '.join(texts)}."


def _volume(volumes: Sequence[Row]) -> str:
    most = {row["arm"]: row for row in reversed(volumes) if row["cell"] in (None, 0.1)}
    late, early = most["covariance_intersection"], most["early"]
    ratio = early["megabytes_per_second"] / max(late["megabytes_per_second"], 1e-12)
    return (
        f"Points need {ratio:.0f} times the bytes of boxes ({early['megabytes_per_second']:.3f} and "
        f"{late['megabytes_per_second']:.3f} MB/s over all links), for an AP 0.7 of "
        f"{early['ap_70']:.3f} and {late['ap_70']:.3f}."
    )


def _sorting(arms: Sequence[Row]) -> str:
    lost = [row["ap_50"] - row["ap_50_local_sort"] for row in arms]
    gained = [number(row, "ap_50_hit") - row["ap_50"] for row in arms]
    return (
        f"Local sort lowers AP 0.5 by {min(lost):.3f} to {max(lost):.3f}. With hit objects only it is higher by "
        f"{min(gained):.3f} to {max(gained):.3f}."
    )


def _departures(arms: Mapping[str, Row]) -> Iterator[str]:
    """Yield results that differ from those of learned detectors, with likely reasons."""
    late, early, alone, filtered, mean = (
        arms[name] for name in ("covariance_intersection", "early", "none", "none, filtered", "average")
    )
    if early["ap_50"] < late["ap_50"]:
        yield (
            f"{REASON} (early fusion is below covariance intersection, other than in the literature): "
            "covariance intersection uses earlier scans, which own detections alone gain "
            f"{filtered['ap_50'] - alone['ap_50']:+.3f} from; and the detector groups points by "
            "the distance from the ego, which suits points of others less the farther they are (AP 0.5 of "
            f"{number(early, 'ap_50_range_2'):.3f} against {number(late, 'ap_50_range_2'):.3f} from {RANGES[1]:g} "
            "m on)."
        )
    if number(mean, "ap_50_range_0") < number(alone, "ap_50_range_0"):
        yield (
            f"{REASON} (up to {RANGES[0]:g} m `average` has an AP 0.5 of {number(mean, 'ap_50_range_0'):.3f} and the "
            f"ego alone {number(alone, 'ap_50_range_0'):.3f}): the mean gives boxes of parts of an object "
            "the same weight as a complete one, and all boxes within 4 m are one object."
        )


SCENES = ("coop/scenario_3", "coop/scenario_4", "coop/scenario_5", "coop/scenario_7")
"""Parked ego with a vehicle, and with roadside units; driven ego with both at two sites."""
DETECTORS = ("lidar",)
DURATION = 8.0
"""End of a run [s]."""


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return one run per scene, in which all arms measure the same frames, and the drives with pose errors."""
    return measured_cases(detectors, STUDY) + pose_errors.cases(detectors)


def measured_cases(detectors: Sequence[str], study: Study) -> list[Case]:
    """Return one run per scene and detector, in which all arms of a study measure the same frames."""
    return [
        Case(scene, detector, RunSettings(detector=detector, time_limit=DURATION), conditions=study.conditions)
        for scene, detector in product(SCENES, detectors)
    ]


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: protocol, results without faults, curves, hidden objects, volume, and shapes of the curves."""
    result = StudyResult(STUDY, records(episodes))
    sections = (
        Section("Set-up", setup(result, len({episode.seed for episode in episodes}))),
        Section("Protocol", protocol(STUDY)),
        *result_sections(conclusions(result), result.arm_table()),
        shape_section(result),
        *result.curve_sections(),
        pose_errors.section(episodes),
        *result.data_sections(),
    )
    return PartReport(PART.title, sections)


PART = Part(
    "perception",
    "Average precision of cooperative perception",
    (
        "What do late and early fusion gain in average precision, how much of it do pose errors, latency, loss and "
        "fewer bytes cost, and do pose errors make the ego brake?"
    ),
    4,
    DETECTORS,
    cases,
    report,
)
