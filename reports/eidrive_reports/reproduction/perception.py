"""Cooperative perception as its field reports it: average precision over pose error, latency, loss and volume."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

from eidrive_reports.cooperative_perception.receivers import (
    ARMS,
    AXES,
    COMPARED,
    DRIFT_TIME,
    LEAST_EXISTENCE,
    SCAN_RATE,
    YAW_PER_POSITION,
    Condition,
    all_conditions,
    by_volume,
    on_axis,
)
from eidrive_reports.cooperative_perception.scores import OVERLAPS, RANGES, PerceptionRecord, Pool
from eidrive_reports.cooperative_perception.trial import FIRST_SAMPLE, SAMPLE_INTERVAL
from eidrive_reports.reproduction import pose_errors
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
from eidrive_reports.reproduction.part import Case, Part, by_case
from eidrive_reports.reproduction.perception_shapes import SHAPE_COLUMNS, crossing, shapes
from eidrive_scenario.api.run import RunSettings

SENDING = ("average", "covariance_intersection", "covariance_intersection, aligned", "early")


def setup(records: Sequence[PerceptionRecord], seeds: int, scenes: int) -> tuple[str, ...]:
    """Return the paragraphs about runs and arms."""
    frames, objects = sum(one.frames for one in records), sum(sum(one.objects) for one in records)
    hit, hidden = sum(sum(one.hit) for one in records), sum(one.hidden for one in records)
    return (
        f"{scenes} scenes of the library with {seeds} seeds each: scenario 3 (parked ego, one vehicle sends), 4 "
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


def protocol() -> tuple[str, ...]:
    """Return the paragraphs about the evaluation."""
    return (
        f"Truth: all road users present at the current time with a center within {RANGES[-1]:g} m of that of the "
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


def conclusions(arms: Sequence[Row], curves: Sequence[Row], volumes: Sequence[Row]) -> tuple[str, ...]:
    """Return the paragraphs about the measured values."""
    by_arm = {str(row["arm"]): row for row in arms}
    listed = [
        f"{name} {number(row, 'ap_30'):.3f}, {number(row, 'ap_50'):.3f} and {number(row, 'ap_70'):.3f}"
        for name, row in by_arm.items()
    ]
    hidden = [f"{name} {number(row, 'hidden_50'):.0%}" for name, row in by_arm.items()]
    return (
        f"Without faults, AP at 0.3, 0.5 and 0.7: {'; '.join(listed)}.",
        f"Hidden objects that are found at 0.5: {', '.join(hidden)}.",
        *(_limits(curves, axis) for axis in AXES),
        _volume(volumes),
        _sorting(arms),
        *_departures(by_arm),
    )


def _limits(curves: Sequence[Row], axis: str) -> str:
    """Return at which value of an axis the arms fall below no fusion."""
    texts = []
    for arm in SENDING:
        ends = []
        for overlap in (0.5, 0.7):
            mine, alone = (
                {
                    number(row, "value"): number(row, "ap")
                    for row in curves
                    if (row["arm"], row["axis"], row["range"], row["iou"]) == (name, axis, "all", overlap)
                }
                for name in (arm, "none")
            )
            at = crossing(mine, alone[0.0])
            ends.append("nowhere" if at is None else f"from {at:.2f}")
        texts.append(f"`{arm}` {ends[0]} and {ends[1]}")
    unit = {"latency": " [s]", "loss": ""}.get(axis, " [m]")
    return f"Below no fusion in AP 0.5 and AP 0.7 over {axis}{unit}, interpolated: {'; '.join(texts)}."


def _volume(volumes: Sequence[Row]) -> str:
    most = {str(row["arm"]): row for row in reversed(volumes) if row["cell"] in (None, 0.1)}
    late, early = most["covariance_intersection"], most["early"]
    ratio = number(early, "megabytes_per_second") / max(number(late, "megabytes_per_second"), 1e-12)
    return (
        f"Points need {ratio:.0f} times the bytes of boxes ({number(early, 'megabytes_per_second'):.3f} and "
        f"{number(late, 'megabytes_per_second'):.3f} MB/s over all links), for an AP 0.7 of "
        f"{number(early, 'ap_70'):.3f} and {number(late, 'ap_70'):.3f}."
    )


def _sorting(arms: Sequence[Row]) -> str:
    lost = [number(row, "ap_50") - number(row, "ap_50_local_sort") for row in arms]
    gained = [number(row, "ap_50_hit") - number(row, "ap_50") for row in arms]
    return (
        f"Local sort lowers AP 0.5 by {min(lost):.3f} to {max(lost):.3f}. With hit objects only it is higher by "
        f"{min(gained):.3f} to {max(gained):.3f}."
    )


def _departures(arms: Mapping[str, Row]) -> Iterator[str]:
    """Yield results that differ from those of learned detectors, with likely reasons."""
    late, early, alone, filtered, mean = (
        arms[name] for name in ("covariance_intersection", "early", "none", "none, filtered", "average")
    )
    if number(early, "ap_50") < number(late, "ap_50"):
        yield (
            f"{REASON} (early fusion is below covariance intersection, other than in the literature): "
            "covariance intersection uses earlier scans, which own detections alone gain "
            f"{number(filtered, 'ap_50') - number(alone, 'ap_50'):+.3f} from; and the detector groups points by "
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
ALL_RANGES = "all"


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return one run per scene, in which all arms measure the same frames, and the drives with pose errors."""
    conditions = all_conditions()
    measured = [
        Case(scene, detector, RunSettings(detector=detector, time_limit=DURATION), conditions=conditions)
        for scene, detector in product(SCENES, detectors)
    ]
    return measured + pose_errors.cases(detectors)


def records(episodes: Sequence[Episode]) -> list[PerceptionRecord]:
    """Return the measurements by scene and seed."""
    ordered = [one for mine in by_case(episodes).values() for one in mine]
    return [one.perception for one in ordered if one.perception is not None]


def range_name(place: int | None) -> str:
    """Return the name of a range class, such as `30 to 50 m`."""
    if place is None:
        return ALL_RANGES
    return f"{RANGES[place - 1] if place else 0.0:g} to {RANGES[place]:g} m"


def curve_rows(found: Sequence[PerceptionRecord]) -> Iterator[Row]:
    """Yield the average precision of each arm over each axis, by range and overlap."""
    places: tuple[int | None, ...] = (None, *range(len(RANGES)))
    for arm, axis in product(COMPARED, AXES):
        for value in AXES[axis][2]:
            pool = Pool(found, on_axis(arm, axis, value).name)
            for place, (index, overlap) in product(places, enumerate(OVERLAPS)):
                one = pool.precision(index, place)
                yield {
                    "arm": arm,
                    "axis": axis,
                    "value": value,
                    "range": range_name(place),
                    "iou": overlap,
                    "ap": finite(one.value),
                    "low": finite(one.low),
                    "high": finite(one.high),
                    "ap_local_sort": finite(one.local),
                    "objects": one.objects,
                }


def hidden_rows(found: Sequence[PerceptionRecord]) -> Iterator[Row]:
    """Yield the recall of objects that are hidden to the ego and that the lidar of another station hits."""
    for arm, axis in product(COMPARED, AXES):
        for value in AXES[axis][2]:
            pool = Pool(found, on_axis(arm, axis, value).name)
            for index, overlap in enumerate(OVERLAPS):
                one = pool.hidden_recall(index)
                place: dict[str, Value] = {"arm": arm, "axis": axis, "value": value, "iou": overlap}
                counts: dict[str, Value] = {"found": one.found, "hidden": one.objects}
                limits = {"low": finite(one.low), "high": finite(one.high)}
                yield {**place, **counts, "recall": finite(one.value), **limits}


def arm_rows(found: Sequence[PerceptionRecord]) -> Iterator[Row]:
    """Yield the results of each arm without faults, with both ways of sorting and both truths."""
    for arm in ARMS:
        pool = Pool(found, Condition(arm).name)
        whole = [pool.precision(number) for number in range(len(OVERLAPS))]
        row: dict[str, Value] = {"arm": arm}
        for overlap, one in zip(OVERLAPS, whole, strict=True):
            row |= {
                f"ap_{_key(overlap)}": one.value,
                f"low_{_key(overlap)}": finite(one.low),
                f"high_{_key(overlap)}": finite(one.high),
            }
        for place in range(len(RANGES)):
            row[f"ap_50_range_{place}"] = finite(pool.precision(1, place).value)
        row["ap_50_local_sort"] = whole[1].local
        row["ap_50_hit"] = finite(pool.precision_of_hit_objects().value)
        row["hidden_50"] = finite(pool.hidden_recall(1).value)
        yield row


def volume_rows(found: Sequence[PerceptionRecord]) -> Iterator[Row]:
    """Yield the average precision beside the size of the messages, for the ego alone and for each way of sending."""
    for one in (Condition("none"), *by_volume()):
        pool = Pool(found, one.name)
        sends = ARMS[one.arm].cooperates
        row: dict[str, Value] = {
            "arm": one.arm,
            "messages_per_second": SCAN_RATE / one.every if sends else None,
            "cell": one.cell if ARMS[one.arm].points else None,
            "megabytes_per_second": pool.megabytes_per_second,
        }
        yield row | {f"ap_{_key(overlap)}": pool.precision(number).value for number, overlap in enumerate(OVERLAPS)}


def _place(axis: str, value: float) -> dict[str, Value]:
    return {"axis": axis, "value": value}


def _key(overlap: float) -> int:
    """Return the overlap in percent, for names of fields."""
    return round(100.0 * overlap)


def _precision(overlap: float) -> Column:
    fields = (f"ap_{_key(overlap)}", f"low_{_key(overlap)}", f"high_{_key(overlap)}")
    value, low, high = (f"{{{name}:{form}}}" for name, form in zip(fields, (".3f", ".2f", ".2f"), strict=True))
    return Column(f"AP {overlap:g} (95 %)", f"{value} ({low} to {high})", fields)


ARM_COLUMNS = (
    plain("arm", "arm"),
    *(_precision(overlap) for overlap in OVERLAPS),
    *(plain(f"AP 0.5, {range_name(place)}", f"ap_50_range_{place}", ".3f") for place in range(len(RANGES))),
    plain("AP 0.5, local sort", "ap_50_local_sort", ".3f"),
    plain("AP 0.5, hit objects", "ap_50_hit", ".3f"),
    plain("recall of hidden objects, 0.5", "hidden_50", ".3f"),
)
CURVE_COLUMNS = (
    plain("axis", "axis"),
    plain("value", "value", "g"),
    *(plain(f"{arm}, AP {overlap:g}", f"{arm}_{_key(overlap)}", ".3f") for overlap in OVERLAPS[1:] for arm in COMPARED),
)
HIDDEN_COLUMNS = (
    plain("axis", "axis"),
    plain("value", "value", "g"),
    *(plain(arm, arm, ".3f") for arm in COMPARED),
    plain("objects", "hidden"),
)
VOLUME_COLUMNS = (
    plain("arm", "arm"),
    plain("messages per second", "messages_per_second", "g"),
    plain("grid [m]", "cell", "g"),
    plain("MB/s", "megabytes_per_second", ".4f"),
    *(plain(f"AP {overlap:g}", f"ap_{_key(overlap)}", ".3f") for overlap in OVERLAPS),
)


def _curve_table(rows: Sequence[Row]) -> DataTable:
    """Return the table of all ranges with one column per arm and overlap."""
    held = {
        (row["axis"], row["value"], row["arm"], row["iou"]): row["ap"] for row in rows if row["range"] == ALL_RANGES
    }
    lines: list[Row] = [
        _place(axis, value)
        | {f"{arm}_{_key(overlap)}": held[axis, value, arm, overlap] for arm in COMPARED for overlap in OVERLAPS}
        for axis, (_, _, values) in AXES.items()
        for value in values
    ]
    return DataTable("perception_curves", CURVE_COLUMNS, tuple(lines))


def _hidden_table(rows: Sequence[Row]) -> DataTable:
    """Return the table of the recall at the overlap 0.5 with one column per arm."""
    held = {(row["axis"], row["value"], row["arm"]): row for row in rows if row["iou"] == OVERLAPS[1]}
    lines: list[Row] = [
        _place(axis, value)
        | {arm: held[axis, value, arm]["recall"] for arm in COMPARED}
        | {"hidden": held[axis, value, COMPARED[0]]["hidden"]}
        for axis, (_, _, values) in AXES.items()
        for value in values
    ]
    return DataTable("perception_hidden_curves", HIDDEN_COLUMNS, tuple(lines))


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: protocol, results without faults, curves, hidden objects, volume, and shapes of the curves."""
    found = records(episodes)
    curves, hidden = tuple(curve_rows(found)), tuple(hidden_rows(found))
    arms, volumes = tuple(arm_rows(found)), tuple(volume_rows(found))
    seen = shapes(curves, volumes)
    seeds = len({one.seed for one in episodes})
    sections = (
        Section("Set-up", setup(found, seeds, len(SCENES))),
        Section("Protocol", protocol()),
        *result_sections(conclusions(arms, curves, volumes), DataTable("perception_arms", ARM_COLUMNS, arms)),
        Section("Shapes of the curves", (), DataTable("perception_shapes", SHAPE_COLUMNS, seen)),
        Section(
            "Curves",
            ("Average precision over all ranges.",),
            _curve_table(curves),
        ),
        Section(
            "Objects hidden to the ego",
            ("Recall at the overlap 0.5.",),
            _hidden_table(hidden),
        ),
        Section("Precision and volume", (), DataTable("perception_volume", VOLUME_COLUMNS, volumes)),
        pose_errors.section(episodes),
        Section(
            "Data",
            ("By arm, axis, value, range and overlap, with interval and local sort: perception.csv.",),
            DataTable("perception", (), curves),
        ),
        Section(
            "Data on hidden objects",
            ("Recall by arm, axis, value and overlap, with intervals: perception_hidden.csv.",),
            DataTable("perception_hidden", (), hidden),
        ),
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
    DETECTORS,
    cases,
    report,
)
