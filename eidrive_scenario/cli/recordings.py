"""Commands on recordings: `judge` and `export`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import typer

from eidrive_scenario.cli.options import check_output_paths
from eidrive_scenario.cli.output import (
    echo,
    echo_path,
    has_all_characters,
    print_error,
    print_warnings,
    show_traceback,
)
from eidrive_scenario.errors import Diagnostic, EidriveError, InputError, SettingError


def judge(
    context: typer.Context,
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING", help="A recording.mcap, or a folder of one or several runs.")
    ],
    criterion: Annotated[
        list[str] | None,
        typer.Option(
            metavar="YAML|FILE",
            help="Criteria instead of those of the run, such as '{collision: {of: Ego}}'; repeatable.",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object per recording only.")] = False,
) -> None:
    """Judge recorded runs again, with their own or other criteria, several in one table.

    Example: eidrive judge reports/scenario_1 --criterion '{max_speed: {of: Ego, at_most: 10}}'

    Exit codes as for eidrive run, of several runs the highest; 3 also for an incomplete or damaged recording.
    """
    from eidrive_scenario.experiments.judgement import FailedJudgement, Judgement, judge_recording
    from eidrive_scenario.experiments.single_run import as_json_text
    from eidrive_scenario.recording.run_files import recordings_in

    paths = [path for location in recordings for path in recordings_in(location)]
    judgements: list[Judgement | FailedJudgement] = []
    for path in paths:
        judgement: Judgement | FailedJudgement
        try:
            judgement = judge_recording(path, criterion or None)
        except EidriveError as error:
            if len(paths) == 1:
                raise
            judgement = FailedJudgement(path, error)
            if isinstance(error, InputError):
                for diagnostic in error.at(str(path)).diagnostics:
                    echo(str(diagnostic), err=True)
            elif context.find_root().params.get("traceback"):
                show_traceback(error)
            else:
                print_error(error, "judgement", path)
        judgements.append(judgement)
        if json:
            echo(as_json_text(judgement, ascii_only=not has_all_characters()))
        if isinstance(judgement, Judgement) and (json or len(paths) > 1):
            print_warnings(f"{path}: {warning}" if len(paths) > 1 else warning for warning in judgement.warnings)
    if not json:
        from eidrive_scenario.cli.console import show_judgement, show_judgements

        if len(judgements) == 1 and isinstance(judgements[0], Judgement):
            show_judgement(judgements[0])
        else:
            show_judgements(judgements)
    raise typer.Exit(max(judgement.exit_code for judgement in judgements))


TableName = Literal["actors", "objects", "plans", "messages", "transitions", "verdicts"]
"""Tables of a run for CSV and Parquet files."""


def export(
    recording: Annotated[Path, typer.Argument(help="A recording.mcap, or the folder of a run.")],
    osi: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="ASAM OSI trace: *.mcap (multi-channel) or *.osi (ground truth)."),
    ] = None,
    foxglove: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="MCAP file for Foxglove or Lichtblick: 3D scene, cameras, log, plots."),
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The recording with the topics of --osi and --foxglove."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(metavar="FILE", help="Table as CSV.")] = None,
    parquet: Annotated[Path | None, typer.Option(metavar="FILE", help="Table as Parquet.")] = None,
    table: Annotated[
        TableName | None, typer.Option(help="Table of --csv and --parquet.", show_default="actors")
    ] = None,
) -> None:
    """Write a recorded run as files of other tools.

    Example: eidrive export reports/scenario_1 --mcap run.mcap --csv motion.csv
    """
    from functools import partial

    from eidrive_scenario.export.foxglove.writer import write_foxglove
    from eidrive_scenario.export.osi.trace import write_osi
    from eidrive_scenario.export.recorded_run import open_run
    from eidrive_scenario.export.tables import write_csv, write_parquet
    from eidrive_scenario.export.tool_topics import write_with_topics

    writers: dict[str, tuple[Path | None, Callable[..., None]]] = {
        "--osi": (osi, write_osi),
        "--foxglove": (foxglove, write_foxglove),
        "--mcap": (mcap, write_with_topics),
        "--csv": (csv, partial(write_csv, table=table or "actors")),
        "--parquet": (parquet, partial(write_parquet, table=table or "actors")),
    }
    given = {option: (path, write) for option, (path, write) in writers.items() if path is not None}
    if not given:
        raise SettingError(Diagnostic("no output is given", f"give one or several of {', '.join(writers)}"))
    if table is not None and csv is None and parquet is None:
        raise SettingError(Diagnostic("--table without a table has no effect", "add --csv or --parquet FILE"))
    run = open_run(recording)
    check_output_paths({option: path for option, (path, _) in given.items()}, [run.recording.path])
    for path, write in given.values():
        write(run, path)
        echo_path(path)
    print_warnings(dict.fromkeys(run.warnings))
