"""Command `eidrive export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


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
) -> None:
    """Write a recorded run as files of other tools.

    Example: eidrive export reports/scenario_1 --osi trace.mcap --foxglove run.mcap
    """
    from eidrive_scenario.cli.output_paths import check_output_paths
    from eidrive_scenario.errors import Diagnostic, SettingError
    from eidrive_scenario.export.foxglove.writer import write_foxglove
    from eidrive_scenario.export.osi.trace import write_osi
    from eidrive_scenario.export.recorded_run import open_run

    writers = {"--osi": (osi, write_osi), "--foxglove": (foxglove, write_foxglove)}
    given = {option: (path, write) for option, (path, write) in writers.items() if path is not None}
    if not given:
        raise SettingError(Diagnostic("no output is given", f"give one or several of {', '.join(writers)}"))
    run = open_run(recording)
    check_output_paths({option: path for option, (path, _) in given.items()}, [run.recording.path])
    for path, write in given.values():
        write(run, path)
        typer.echo(str(path))
    for warning in run.warnings:
        typer.secho(f"warning: {warning}", fg="yellow", err=True)
