"""Rows and tables of the average precision of cooperative perception, for the conditions of a study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
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


def range_name(range_class: int | None) -> str:
    """Return the name of a range class, such as `30 to 50 m`."""
    if range_class is None:
        return ALL_RANGES
    return f"{RANGES[range_class - 1] if range_class else 0.0:g} to {RANGES[range_class]:g} m"


def _key(overlap: float) -> int:
    """Return the overlap in percent, for names of fields."""
    return round(100.0 * overlap)


def _precision(overlap: float) -> Column:
    key = _key(overlap)
    return Column(f"AP {overlap:g} (95 %)", f"{{ap_{key}:.3f}} ({{low_{key}:.2f}} to {{high_{key}:.2f}})")


AXIS_COLUMNS = (plain("axis"), plain("value", "value", "g"))
VOLUME_COLUMNS = (
    plain("arm"),
    plain("messages per second", "messages_per_second", "g"),
    plain("grid [m]", "cell", "g"),
    plain("share of the cells", "share", "g"),
    plain("encoding"),
    plain("MB/s", "megabytes_per_second", ".4f"),
    *(plain(f"AP {overlap:g}", f"ap_{_key(overlap)}", ".3f") for overlap in OVERLAPS),
)


@dataclass(frozen=True)
class StudyResult:
    """Measurements of a study by scene and seed, with the rows of its tables."""

    study: Study
    measured: Sequence[PerceptionRecord]

    @property
    def object_counts(self) -> tuple[int, int, int, int]:
        """Number of frames, of objects in the ranges of the study, of those that any lidar hits, and of those hidden
        to the ego."""
        reach = self.study.reach
        counts = [
            (record.frames, sum(record.objects[:reach]), sum(record.hit[:reach]), sum(record.hidden[:reach]))
            for record in self.measured
        ]
        frames, objects, hit, hidden = (sum(values) for values in zip(*counts, strict=True))
        return frames, objects, hit, hidden

    def _pool(self, condition: Condition) -> Pool:
        """Return the detections of a condition in the ranges of the study."""
        return Pool(self.measured, condition.name, self.study.reach)

    def _pools_on_axes(self) -> Iterator[tuple[Row, Pool]]:
        for arm, axis in product(self.study.compared, self.study.axes):
            for value in AXES[axis][2]:
                yield {"arm": arm, "axis": axis, "value": value}, self._pool(on_axis(arm, axis, value))

    @cached_property
    def curves(self) -> tuple[Row, ...]:
        """Average precision of each arm over each axis, by range and overlap."""
        return tuple(
            {
                **key,
                "range": range_name(range_class),
                "iou": overlap,
                "ap": finite(precision.value),
                **bounds(precision),
                "ap_local_sort": finite(precision.local),
                "objects": precision.objects,
            }
            for key, pool in self._pools_on_axes()
            for range_class, (index, overlap) in product((None, *range(self.study.reach)), enumerate(OVERLAPS))
            for precision in (pool.precision(index, range_class),)
        )

    @cached_property
    def hidden(self) -> tuple[Row, ...]:
        """Recall of objects that are hidden to the ego and that the lidar of another station hits."""
        return tuple(
            {
                **key,
                "iou": overlap,
                "detected": recall.detected,
                "hidden": recall.objects,
                "recall": finite(recall.value),
                **bounds(recall),
            }
            for key, pool in self._pools_on_axes()
            for index, overlap in enumerate(OVERLAPS)
            for recall in (pool.hidden_recall(index),)
        )

    @cached_property
    def arms(self) -> tuple[Row, ...]:
        """Results of each arm without faults, with both ways of sorting and both truths."""
        rows = []
        for arm in self.study.arms:
            pool = self._pool(Condition(arm))
            precisions = [pool.precision(index) for index in range(len(OVERLAPS))]
            fields: dict[str, Any] = {"arm": arm}
            for overlap, precision in zip(OVERLAPS, precisions, strict=True):
                values = {"ap": precision.value, **bounds(precision)}
                fields |= {f"{name}_{_key(overlap)}": value for name, value in values.items()}
            for range_class in range(self.study.reach):
                fields[f"ap_50_range_{range_class}"] = finite(pool.precision(1, range_class).value)
            fields["ap_50_local_sort"] = precisions[1].local
            fields["ap_50_hit"] = finite(pool.precision_of_hit_objects().value)
            fields["hidden_50"] = finite(pool.hidden_recall(1).value)
            rows.append(fields)
        return tuple(rows)

    @cached_property
    def volumes(self) -> tuple[Row, ...]:
        """Average precision beside the size of the messages, for the ego alone and for each way of sending.

        share  of the cells of a map of features
        """
        rows = []
        for condition in (Condition(self.study.arms[0]), *self.study.volumes):
            pool, arm = self._pool(condition), ARMS[condition.arm]
            fields = {
                "arm": condition.arm,
                "messages_per_second": SCAN_RATE / condition.every if arm.cooperates else None,
                "cell": condition.cell if arm.shares == "points" else None,
                "share": arm.settings.get("share"),
                "encoding": arm.settings.get("encoding"),
                "megabytes_per_second": pool.megabytes_per_second,
            }
            precisions = {f"ap_{_key(overlap)}": pool.precision(index).value for index, overlap in enumerate(OVERLAPS)}
            rows.append({**fields, **precisions})
        return tuple(rows)

    def arm_table(self) -> DataTable:
        """Return the table of the arms without faults."""
        reach = range(self.study.reach)
        columns = (
            plain("arm"),
            *(_precision(overlap) for overlap in OVERLAPS),
            *(plain(f"AP 0.5, {range_name(number)}", f"ap_50_range_{number}", ".3f") for number in reach),
            plain("AP 0.5, local sort", "ap_50_local_sort", ".3f"),
            plain("AP 0.5, hit objects", "ap_50_hit", ".3f"),
            plain("recall of hidden objects, 0.5", "hidden_50", ".3f"),
        )
        return DataTable(f"{self.study.name}_arms", columns, self.arms)

    def curve_sections(self) -> tuple[Section, ...]:
        """Return the sections with the tables of curves, hidden objects and volume."""
        name, arms = self.study.name, self.study.compared
        curves = [
            {"axis": axis, "value": value, **{f"{row['arm']}_{_key(row['iou'])}": row["ap"] for row in mine}}
            for (axis, value), mine in groups(where(self.curves, range=ALL_RANGES), "axis", "value").items()
        ]
        precisions = (
            plain(f"{arm}, AP {overlap:g}", f"{arm}_{_key(overlap)}", ".3f") for overlap in OVERLAPS[1:] for arm in arms
        )
        hidden = [
            {"axis": axis, "value": value, **{row["arm"]: row["recall"] for row in mine}, "hidden": mine[0]["hidden"]}
            for (axis, value), mine in groups(where(self.hidden, iou=OVERLAPS[1]), "axis", "value").items()
        ]
        recalls = (*(plain(arm, arm, ".3f") for arm in arms), plain("objects", "hidden"))
        # Volumes have the columns that differ between their rows
        volumes = [
            column
            for column in VOLUME_COLUMNS
            for field in column.fields
            if field in ("arm", "megabytes_per_second") or len({row[field] for row in self.volumes} - {None}) > 1
        ]
        tables = (
            DataTable(f"{name}_curves", (*AXIS_COLUMNS, *precisions), tuple(curves)),
            DataTable(f"{name}_hidden_curves", (*AXIS_COLUMNS, *recalls), tuple(hidden)),
            DataTable(f"{name}_volume", tuple(volumes), self.volumes),
        )
        return (
            Section("Curves", ("Average precision over all ranges.",), tables[0]),
            Section("Objects hidden to the ego", ("Recall at the overlap 0.5.",), tables[1]),
            Section("Precision and volume", (), tables[2]),
        )

    def data_sections(self) -> tuple[Section, ...]:
        """Return the sections that name the files with all rows of curves and hidden objects."""
        name = self.study.name
        curves = f"By arm, axis, value, range and overlap, with interval and local sort: {name}.csv."
        hidden = f"Recall by arm, axis, value and overlap, with intervals: {name}_hidden.csv."
        return (
            Section("Data", (curves,), DataTable(name, (), self.curves)),
            Section("Data on hidden objects", (hidden,), DataTable(f"{name}_hidden", (), self.hidden)),
        )
