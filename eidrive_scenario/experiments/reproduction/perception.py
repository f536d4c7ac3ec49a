"""Cooperative perception as its field reports it: average precision over pose error, latency, loss and volume."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from eidrive_scenario.experiments.cooperative_perception.conditions import (
    ARMS,
    AXES,
    COMPARED,
    SCAN_RATE,
    Condition,
    all_conditions,
    by_volume,
    on_axis,
)
from eidrive_scenario.experiments.cooperative_perception.samples import OVERLAPS, RANGES, PerceptionRecord
from eidrive_scenario.experiments.cooperative_perception.scores import Pool
from eidrive_scenario.experiments.reproduction import pose_errors
from eidrive_scenario.experiments.reproduction.episodes import Episode
from eidrive_scenario.experiments.reproduction.layout import (
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    Value,
    plain,
    result_sections,
)
from eidrive_scenario.experiments.reproduction.part import Case, Part, by_case
from eidrive_scenario.experiments.reproduction.perception_shapes import SHAPE_COLUMNS, shapes
from eidrive_scenario.experiments.reproduction.perception_text import conclusions, protocol, setup
from eidrive_scenario.experiments.reproduction.rows import finite
from eidrive_scenario.simulation import RunSettings

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
            for place, (number, overlap) in product(places, enumerate(OVERLAPS)):
                one = pool.precision(number, place)
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
            for number, overlap in enumerate(OVERLAPS):
                one = pool.hidden_recall(number)
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
