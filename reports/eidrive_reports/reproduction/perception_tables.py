"""Rows and tables of the average precision of cooperative perception, for the conditions of a study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from eidrive_reports.cooperative_perception.receivers import ARMS, AXES, SCAN_RATE, Condition, Study, on_axis
from eidrive_reports.cooperative_perception.scores import OVERLAPS, RANGES, PerceptionRecord, Pool
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import Column, DataTable, Row, Section, Value, finite, plain
from eidrive_reports.reproduction.part import by_case

ALL_RANGES = "all"


def records(episodes: Sequence[Episode]) -> list[PerceptionRecord]:
    """Return the measurements by scene and seed."""
    ordered = [one for mine in by_case(episodes).values() for one in mine]
    return [one.perception for one in ordered if one.perception is not None]


def pool(measurements: Sequence[PerceptionRecord], study: Study, condition: Condition) -> Pool:
    """Return the detections of a condition in the ranges of a study."""
    return Pool(measurements, condition.name, study.reach)


def range_name(place: int | None) -> str:
    """Return the name of a range class, such as `30 to 50 m`."""
    if place is None:
        return ALL_RANGES
    return f"{RANGES[place - 1] if place else 0.0:g} to {RANGES[place]:g} m"


def curve_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the average precision of each arm over each axis, by range and overlap."""
    places: tuple[int | None, ...] = (None, *range(study.reach))
    for arm, axis in product(study.compared, study.axes):
        for value in AXES[axis][2]:
            measured = pool(measurements, study, on_axis(arm, axis, value))
            for place, (index, overlap) in product(places, enumerate(OVERLAPS)):
                one = measured.precision(index, place)
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


def hidden_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the recall of objects that are hidden to the ego and that the lidar of another station hits."""
    for arm, axis in product(study.compared, study.axes):
        for value in AXES[axis][2]:
            measured = pool(measurements, study, on_axis(arm, axis, value))
            for index, overlap in enumerate(OVERLAPS):
                one = measured.hidden_recall(index)
                place: dict[str, Value] = {"arm": arm, "axis": axis, "value": value, "iou": overlap}
                counts: dict[str, Value] = {"found": one.found, "hidden": one.objects}
                limits = {"low": finite(one.low), "high": finite(one.high)}
                yield {**place, **counts, "recall": finite(one.value), **limits}


def arm_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the results of each arm without faults, with both ways of sorting and both truths."""
    for arm in study.arms:
        measured = pool(measurements, study, Condition(arm))
        whole = [measured.precision(number) for number in range(len(OVERLAPS))]
        row: dict[str, Value] = {"arm": arm}
        for overlap, one in zip(OVERLAPS, whole, strict=True):
            row |= {
                f"ap_{_key(overlap)}": one.value,
                f"low_{_key(overlap)}": finite(one.low),
                f"high_{_key(overlap)}": finite(one.high),
            }
        for place in range(study.reach):
            row[f"ap_50_range_{place}"] = finite(measured.precision(1, place).value)
        row["ap_50_local_sort"] = whole[1].local
        row["ap_50_hit"] = finite(measured.precision_of_hit_objects().value)
        row["hidden_50"] = finite(measured.hidden_recall(1).value)
        yield row


def volume_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the average precision beside the size of the messages, for the ego alone and for each way of sending.

    share  of the cells of a map of features
    """
    for one in (Condition(study.arms[0]), *study.volumes):
        measured, arm = pool(measurements, study, one), ARMS[one.arm]
        row: dict[str, Value] = {
            "arm": one.arm,
            "messages_per_second": SCAN_RATE / one.every if arm.cooperates else None,
            "cell": one.cell if arm.shares == "points" else None,
            "share": arm.settings.get("share"),
            "encoding": arm.settings.get("encoding"),
            "megabytes_per_second": measured.megabytes_per_second,
        }
        yield row | {f"ap_{_key(overlap)}": measured.precision(index).value for index, overlap in enumerate(OVERLAPS)}


def _place(axis: str, value: float) -> dict[str, Value]:
    return {"axis": axis, "value": value}


def _key(overlap: float) -> int:
    """Return the overlap in percent, for names of fields."""
    return round(100.0 * overlap)


def _precision(overlap: float) -> Column:
    fields = (f"ap_{_key(overlap)}", f"low_{_key(overlap)}", f"high_{_key(overlap)}")
    value, low, high = (f"{{{name}:{form}}}" for name, form in zip(fields, (".3f", ".2f", ".2f"), strict=True))
    return Column(f"AP {overlap:g} (95 %)", f"{value} ({low} to {high})", fields)


VOLUME_COLUMNS = (
    plain("arm", "arm"),
    plain("messages per second", "messages_per_second", "g"),
    plain("grid [m]", "cell", "g"),
    plain("share of the cells", "share", "g"),
    plain("encoding", "encoding"),
    plain("MB/s", "megabytes_per_second", ".4f"),
    *(plain(f"AP {overlap:g}", f"ap_{_key(overlap)}", ".3f") for overlap in OVERLAPS),
)


def arm_table(rows: Sequence[Row], study: Study) -> DataTable:
    """Return the table of the arms without faults."""
    columns = (
        plain("arm", "arm"),
        *(_precision(overlap) for overlap in OVERLAPS),
        *(plain(f"AP 0.5, {range_name(place)}", f"ap_50_range_{place}", ".3f") for place in range(study.reach)),
        plain("AP 0.5, local sort", "ap_50_local_sort", ".3f"),
        plain("AP 0.5, hit objects", "ap_50_hit", ".3f"),
        plain("recall of hidden objects, 0.5", "hidden_50", ".3f"),
    )
    return DataTable(f"{study.name}_arms", columns, tuple(rows))


def volume_table(rows: Sequence[Row], study: Study) -> DataTable:
    """Return the table of precision and volume, with the columns that differ between its rows."""
    fields = [
        column
        for column in VOLUME_COLUMNS
        if column.fields[0] in ("arm", "megabytes_per_second")
        or len({row[column.fields[0]] for row in rows} - {None}) > 1
    ]
    return DataTable(f"{study.name}_volume", tuple(fields), tuple(rows))


def curve_table(rows: Sequence[Row], study: Study) -> DataTable:
    """Return the table of all ranges with one column per arm and overlap."""
    held = {
        (row["axis"], row["value"], row["arm"], row["iou"]): row["ap"] for row in rows if row["range"] == ALL_RANGES
    }
    lines: list[Row] = [
        _place(axis, value)
        | {f"{arm}_{_key(overlap)}": held[axis, value, arm, overlap] for arm in study.compared for overlap in OVERLAPS}
        for axis in study.axes
        for value in AXES[axis][2]
    ]
    columns = (
        plain("axis", "axis"),
        plain("value", "value", "g"),
        *(
            plain(f"{arm}, AP {overlap:g}", f"{arm}_{_key(overlap)}", ".3f")
            for overlap in OVERLAPS[1:]
            for arm in study.compared
        ),
    )
    return DataTable(f"{study.name}_curves", columns, tuple(lines))


def hidden_table(rows: Sequence[Row], study: Study) -> DataTable:
    """Return the table of the recall at the overlap 0.5 with one column per arm."""
    held = {(row["axis"], row["value"], row["arm"]): row for row in rows if row["iou"] == OVERLAPS[1]}
    lines: list[Row] = [
        _place(axis, value)
        | {arm: held[axis, value, arm]["recall"] for arm in study.compared}
        | {"hidden": held[axis, value, study.compared[0]]["hidden"]}
        for axis in study.axes
        for value in AXES[axis][2]
    ]
    columns = (
        plain("axis", "axis"),
        plain("value", "value", "g"),
        *(plain(arm, arm, ".3f") for arm in study.compared),
        plain("objects", "hidden"),
    )
    return DataTable(f"{study.name}_hidden_curves", columns, tuple(lines))


def data_sections(curves: Sequence[Row], hidden: Sequence[Row], study: Study) -> tuple[Section, ...]:
    """Return the sections that name the files with all rows of curves and hidden objects."""
    return (
        Section(
            "Data",
            (f"By arm, axis, value, range and overlap, with interval and local sort: {study.name}.csv.",),
            DataTable(study.name, (), tuple(curves)),
        ),
        Section(
            "Data on hidden objects",
            (f"Recall by arm, axis, value and overlap, with intervals: {study.name}_hidden.csv.",),
            DataTable(f"{study.name}_hidden", (), tuple(hidden)),
        ),
    )
