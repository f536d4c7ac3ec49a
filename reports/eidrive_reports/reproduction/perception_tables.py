"""Rows and tables of the average precision of cooperative perception, for the conditions of a study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

from eidrive_reports.cooperative_perception.receivers import ARMS, AXES, SCAN_RATE, Condition, Study, on_axis
from eidrive_reports.cooperative_perception.scores import OVERLAPS, RANGES, PerceptionRecord, Pool
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import Column, DataTable, Row, Section, bounds, finite, groups, plain, where
from eidrive_reports.reproduction.part import by_case

ALL_RANGES = "all"


def records(episodes: Sequence[Episode]) -> list[PerceptionRecord]:
    """Return the measurements by scene and seed."""
    ordered = [episode for mine in by_case(episodes).values() for episode in mine]
    return [episode.perception for episode in ordered if episode.perception is not None]


def object_counts(measurements: Sequence[PerceptionRecord], study: Study) -> tuple[int, int, int, int]:
    """Return the number of frames, of objects in the ranges of a study, of those that any lidar hits, and of those
    hidden to the ego."""
    reach = study.reach
    counts = [
        (record.frames, sum(record.objects[:reach]), sum(record.hit[:reach]), sum(record.hidden[:reach]))
        for record in measurements
    ]
    frames, objects, hit, hidden = (sum(values) for values in zip(*counts, strict=True))
    return frames, objects, hit, hidden


def pool(measurements: Sequence[PerceptionRecord], study: Study, condition: Condition) -> Pool:
    """Return the detections of a condition in the ranges of a study."""
    return Pool(measurements, condition.name, study.reach)


def range_name(range_class: int | None) -> str:
    """Return the name of a range class, such as `30 to 50 m`."""
    if range_class is None:
        return ALL_RANGES
    return f"{RANGES[range_class - 1] if range_class else 0.0:g} to {RANGES[range_class]:g} m"


def curve_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the average precision of each arm over each axis, by range and overlap."""
    classes: tuple[int | None, ...] = (None, *range(study.reach))
    for arm, axis in product(study.compared, study.axes):
        for value in AXES[axis][2]:
            pooled = pool(measurements, study, on_axis(arm, axis, value))
            for range_class, (index, overlap) in product(classes, enumerate(OVERLAPS)):
                precision = pooled.precision(index, range_class)
                yield {
                    "arm": arm,
                    "axis": axis,
                    "value": value,
                    "range": range_name(range_class),
                    "iou": overlap,
                    "ap": finite(precision.value),
                    **bounds(precision),
                    "ap_local_sort": finite(precision.local),
                    "objects": precision.objects,
                }


def hidden_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the recall of objects that are hidden to the ego and that the lidar of another station hits."""
    for arm, axis in product(study.compared, study.axes):
        for value in AXES[axis][2]:
            pooled = pool(measurements, study, on_axis(arm, axis, value))
            for index, overlap in enumerate(OVERLAPS):
                recall = pooled.hidden_recall(index)
                yield {
                    "arm": arm,
                    "axis": axis,
                    "value": value,
                    "iou": overlap,
                    "detected": recall.detected,
                    "hidden": recall.objects,
                    "recall": finite(recall.value),
                    **bounds(recall),
                }


def arm_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the results of each arm without faults, with both ways of sorting and both truths."""
    for arm in study.arms:
        pooled = pool(measurements, study, Condition(arm))
        precisions = [pooled.precision(index) for index in range(len(OVERLAPS))]
        fields: dict[str, Any] = {"arm": arm}
        for overlap, precision in zip(OVERLAPS, precisions, strict=True):
            values = {"ap": precision.value, **bounds(precision)}
            fields |= {f"{name}_{_key(overlap)}": value for name, value in values.items()}
        for range_class in range(study.reach):
            fields[f"ap_50_range_{range_class}"] = finite(pooled.precision(1, range_class).value)
        fields["ap_50_local_sort"] = precisions[1].local
        fields["ap_50_hit"] = finite(pooled.precision_of_hit_objects().value)
        fields["hidden_50"] = finite(pooled.hidden_recall(1).value)
        yield fields


def volume_rows(measurements: Sequence[PerceptionRecord], study: Study) -> Iterator[Row]:
    """Yield the average precision beside the size of the messages, for the ego alone and for each way of sending.

    share  of the cells of a map of features
    """
    for condition in (Condition(study.arms[0]), *study.volumes):
        pooled, arm = pool(measurements, study, condition), ARMS[condition.arm]
        fields: dict[str, Any] = {
            "arm": condition.arm,
            "messages_per_second": SCAN_RATE / condition.every if arm.cooperates else None,
            "cell": condition.cell if arm.shares == "points" else None,
            "share": arm.settings.get("share"),
            "encoding": arm.settings.get("encoding"),
            "megabytes_per_second": pooled.megabytes_per_second,
        }
        yield fields | {f"ap_{_key(overlap)}": pooled.precision(index).value for index, overlap in enumerate(OVERLAPS)}


def _key(overlap: float) -> int:
    """Return the overlap in percent, for names of fields."""
    return round(100.0 * overlap)


def _precision(overlap: float) -> Column:
    key = _key(overlap)
    return Column(f"AP {overlap:g} (95 %)", f"{{ap_{key}:.3f}} ({{low_{key}:.2f}} to {{high_{key}:.2f}})")


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
        *(plain(f"AP 0.5, {range_name(number)}", f"ap_50_range_{number}", ".3f") for number in range(study.reach)),
        plain("AP 0.5, local sort", "ap_50_local_sort", ".3f"),
        plain("AP 0.5, hit objects", "ap_50_hit", ".3f"),
        plain("recall of hidden objects, 0.5", "hidden_50", ".3f"),
    )
    return DataTable(f"{study.name}_arms", columns, tuple(rows))


def volume_table(rows: Sequence[Row], study: Study) -> DataTable:
    """Return the table of precision and volume, with the columns that differ between its rows."""
    columns = [
        column
        for column in VOLUME_COLUMNS
        for field in column.fields
        if field in ("arm", "megabytes_per_second") or len({row[field] for row in rows} - {None}) > 1
    ]
    return DataTable(f"{study.name}_volume", tuple(columns), tuple(rows))


AXIS_COLUMNS = (plain("axis", "axis"), plain("value", "value", "g"))


def curve_table(rows: Sequence[Row], study: Study) -> DataTable:
    """Return the table of all ranges with one column per arm and overlap."""
    lines = [
        {"axis": axis, "value": value, **{f"{row['arm']}_{_key(row['iou'])}": row["ap"] for row in mine}}
        for (axis, value), mine in groups(where(rows, range=ALL_RANGES), "axis", "value").items()
    ]
    columns = (
        *AXIS_COLUMNS,
        *(
            plain(f"{arm}, AP {overlap:g}", f"{arm}_{_key(overlap)}", ".3f")
            for overlap in OVERLAPS[1:]
            for arm in study.compared
        ),
    )
    return DataTable(f"{study.name}_curves", columns, tuple(lines))


def hidden_table(rows: Sequence[Row], study: Study) -> DataTable:
    """Return the table of the recall at the overlap 0.5 with one column per arm."""
    lines = [
        {"axis": axis, "value": value, **{row["arm"]: row["recall"] for row in mine}, "hidden": mine[0]["hidden"]}
        for (axis, value), mine in groups(where(rows, iou=OVERLAPS[1]), "axis", "value").items()
    ]
    columns = (*AXIS_COLUMNS, *(plain(arm, arm, ".3f") for arm in study.compared), plain("objects", "hidden"))
    return DataTable(f"{study.name}_hidden_curves", columns, tuple(lines))


def curve_sections(
    curves: Sequence[Row], hidden: Sequence[Row], volumes: Sequence[Row], study: Study
) -> tuple[Section, ...]:
    """Return the sections with the tables of curves, hidden objects and volume."""
    return (
        Section("Curves", ("Average precision over all ranges.",), curve_table(curves, study)),
        Section("Objects hidden to the ego", ("Recall at the overlap 0.5.",), hidden_table(hidden, study)),
        Section("Precision and volume", (), volume_table(volumes, study)),
    )


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
