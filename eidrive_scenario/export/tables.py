"""Tables of a recorded run (actors, objects, plans, messages, transitions, verdicts) as CSV and Parquet files."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.files.atomic import atomic_output, create
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.csv_writer import csv_text
from eidrive_scenario.v2x.messages.message import LinkEvent

Row = tuple[Any, ...]
Columns = Mapping[str, type]
"""Type of each column: float, int, str or bool. A value may be None."""


@dataclass(frozen=True)
class Table:
    """Table with its columns and its rows for a run."""

    columns: Columns
    rows: Callable[[RecordedRun], Iterator[Row]]


def _columns(names: str) -> Columns:
    """Return columns from their names; one that does not contain numbers is `NAME:TYPE`."""
    types = {"": float, "int": int, "str": str, "bool": bool}
    return {name: types[kind] for name, _, kind in (word.partition(":") for word in names.split())}


def _of_frames(rows: Callable[[Frame], Iterable[Row]]) -> Callable[[RecordedRun], Iterator[Row]]:
    """Return a function that yields the rows of all frames."""
    return lambda run: (row for frame in run.frames() for row in run.converted(frame, rows))


def _actors(frame: Frame) -> Iterator[Row]:
    view = frame.view
    bodies = zip(view.names, view.categories, view.states, view.size.tolist(), strict=True)
    for name, category, state, size in bodies:
        pose = (state.x, state.y, state.z, state.yaw, state.pitch, state.roll)
        motion = (*state[6:12], state.yaw_rate)
        yield (view.time, name, *pose, state.speed, category, *motion, *size, view.tick)


def _objects(frame: Frame) -> Iterator[Row]:
    for station, step in frame.steps.items():
        for kind, objects in (("detections", step.detections), ("fused", step.fused)):
            existence = objects.existence.tolist() or [None] * len(objects)
            tracks = objects.tracks or [None] * len(objects)
            columns = (objects.classes, objects.boxes.tolist(), objects.scores.tolist(), existence)
            rows = zip(*columns, objects.velocity.tolist(), tracks, strict=True)
            for category, box, score, exists, velocity, track in rows:
                yield (frame.view.time, station, kind, category, *box, score, exists, *velocity, track)


def _plans(frame: Frame) -> Iterator[Row]:
    for station, step in frame.steps.items():
        if step.plan is not None:
            plan, control = step.plan, step.control
            speed = float(plan.speeds[0]) if len(plan.speeds) else None
            held = (None,) * 3 if control is None else (control.throttle, control.brake, control.steering)
            yield (frame.view.time, station, plan.reason, speed, plan.acceleration, plan.braking, *held)


def _messages(run: RecordedRun) -> Iterator[Row]:
    # Frames are read twice: whether a message is too old, or its receiver leaves, is known after its outcome
    expired = {message for frame in run.frames() for message in _expired(frame)}
    for frame in run.frames():
        yield from run.converted(frame, lambda frame: _outcomes(run.with_losses(frame).links, expired))
    outcome = run.outcome()
    yield from () if outcome is None else _outcomes(outcome.final_links, expired)


def _expired(frame: Frame) -> Iterator[tuple[str, str, int]]:
    """Yield sender, receiver and number of each received message that is too old."""
    for receiver, step in frame.steps.items():
        for message in (step.inbox[row].message for row in step.expired):
            yield message.sender, receiver, message.number


def _outcomes(events: Iterable[LinkEvent], expired: Container[tuple[str, str, int]]) -> Iterator[Row]:
    for event in events:
        radio = (event.path_loss_db, event.snr_db, event.los, ", ".join(event.blockers))
        outcome = (event.outcome, event.arrives, event.reason, event.size)
        is_expired = (event.sender, event.receiver, event.number) in expired
        yield (event.sent, event.sender, event.receiver, event.number, *outcome, *radio, is_expired)


def _transitions(frame: Frame) -> Iterator[Row]:
    for change in frame.changes:
        transition = None if change.transition is None else change.transition.value
        yield (change.time, change.kind, change.path, transition, change.after.value, change.why)


def _verdicts(run: RecordedRun) -> Iterator[Row]:
    outcome = run.outcome()
    if outcome is None:
        run.warnings.append("the recording contains no verdicts: the run did not end, or an older version recorded it")
        return
    for verdict in outcome.criteria:
        measured = (verdict.value, verdict.limit, verdict.unit, verdict.first_violation)
        yield (verdict.name, verdict.passed, *measured, verdict.reason, "; ".join(verdict.violation_state))


TABLES: Mapping[str, Table] = {
    "actors": Table(
        _columns(
            "time name:str x y z h p r speed category:str vx vy vz ax ay az yaw_rate length width height tick:int"
        ),
        _of_frames(_actors),
    ),
    "objects": Table(
        _columns("time station:str list:str class:str x y z length width height yaw score existence vx vy track:int"),
        _of_frames(_objects),
    ),
    "plans": Table(
        _columns("time station:str reason:str speed acceleration braking throttle brake steering"), _of_frames(_plans)
    ),
    "messages": Table(
        _columns(
            "sent sender:str receiver:str number:int outcome:str arrives reason:str size:int path_loss_db snr_db "
            "los:str blockers:str expired:bool"
        ),
        _messages,
    ),
    "transitions": Table(
        _columns("time kind:str path:str transition:str state:str reason:str"), _of_frames(_transitions)
    ),
    "verdicts": Table(
        _columns("name:str passed:bool value limit unit:str first_violation reason:str violation_state:str"), _verdicts
    ),
}
"""Tables by name."""


_GROUP = 50_000
"""Number of rows of a row group of Parquet."""


def write_csv(run: RecordedRun, path: Path, table: str) -> None:
    """Write a table as CSV. Numbers keep all digits; an unknown value is an empty field.

    Texts that a spreadsheet would evaluate as formulas have a prefix, as in `csv_text`. Raise SettingError if the file
    cannot be written.
    """
    with atomic_output(path) as partial, io.TextIOWrapper(create(partial), encoding="utf-8", newline="") as stream:
        stream.write(",".join(TABLES[table].columns) + "\n")
        for row in TABLES[table].rows(run):
            stream.write(",".join([_field(value) for value in row]) + "\n")


def write_parquet(run: RecordedRun, path: Path, table: str) -> None:
    """Write a table as Parquet; an unknown value is null.

    Raise SettingError if pyarrow is missing, or if the file cannot be written.
    """
    arrow, parquet = optional_import("pyarrow", "tables"), optional_import("pyarrow.parquet", "tables")
    schema = _schema(arrow, TABLES[table].columns)
    rows = TABLES[table].rows(run)
    with (
        atomic_output(path) as partial,
        create(partial) as stream,
        parquet.ParquetWriter(stream, schema, compression="zstd") as writer,
    ):
        while group := list(islice(rows, _GROUP)):
            columns = [[_null_for_nan(value) for value in column] for column in zip(*group, strict=True)]
            writer.write_table(arrow.table(columns, schema=schema))


def _schema(arrow: Any, columns: Columns) -> Any:
    types = {float: arrow.float64(), int: arrow.int64(), str: arrow.string(), bool: arrow.bool_()}
    return arrow.schema([(name, types[kind]) for name, kind in columns.items()])


def _null_for_nan(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def _field(value: Any) -> str:
    value = _null_for_nan(value)
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return csv_text(value) if isinstance(value, str) else repr(value)
