"""Command `eidrive dataset`: datasets for learning from runs, and scenarios from recorded datasets."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from eidrive_scenario.cli.options import HelpAll, check_output_paths, parse_seeds, takes_run_options
from eidrive_scenario.cli.output import echo, echo_path, print_warnings
from eidrive_scenario.errors import ABORTED, PASSED, Diagnostic, SettingError, counted, in_one_line
from eidrive_scenario.run_options import RunSettings

if TYPE_CHECKING:
    from eidrive_scenario.export.opv2v.dataset import ExportedRun


@takes_run_options("dataset", at="out", before={"allow_torchscript": "help_all"})
def dataset(
    settings: RunSettings,
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENARIO]...", help=".xosc files or library names; all runs of a distribution."),
    ] = None,
    format: Annotated[Literal["opv2v"], typer.Option(help="Format of the dataset.")] = "opv2v",
    seeds: Annotated[
        str | None, typer.Option(metavar="A-B|A,B", help="Seeds of each scenario.", show_default="1")
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="Vary a setting or parameter, such as weather=sunny,storm or channel=ideal,congested; repeatable.",
        ),
    ] = None,
    sensors: Annotated[
        str | None,
        typer.Option(
            metavar="YAML|FILE",
            help="Lidar and cameras of all stations.",
            show_default="64 channels, own cameras",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the dataset or of the scenarios.")] = Path("dataset"),
    jobs: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processes.", show_default="number of cores")
    ] = None,
    from_folder: Annotated[
        Path | None,
        typer.Option("--import", metavar="DIR", help="Write a scenario per recording of an OPV2V or DAIR-V2X folder."),
    ] = None,
    help_all: HelpAll = False,
) -> None:
    """Write runs as a dataset for learning, or recorded datasets as scenarios.

    Example: eidrive dataset coop/scenario_1 coop/scenario_2 --seeds 1-10 --vary weather=sunny,storm --out opv2v

    Complete runs are kept, so that the same command continues a killed one.
    """
    check_output_paths({"--out": out}, [])
    if from_folder is not None:
        given = {
            "scenarios": scenarios,
            "--seeds": seeds,
            "--vary": vary,
            "--sensors": sensors,
            "--jobs": jobs,
            "options of a run": settings != RunSettings(),
        }
        excluded = ", ".join(name for name, value in given.items() if value)
        if excluded:
            hint = "stations of recordings get their settings in the file that is written"
            raise SettingError(Diagnostic(f"--import excludes {excluded}", hint))
        _import(from_folder, out)
        return
    if not scenarios:
        raise SettingError(Diagnostic("no scenario is given", "give an .xosc file, a library name, or --import DIR"))
    from eidrive_scenario.cli.console import console
    from eidrive_scenario.experiments.sweeps.axes import parse_axes
    from eidrive_scenario.export.opv2v.dataset import export_dataset, plan_dataset, read_sensors

    planned = plan_dataset(
        scenarios,
        out,
        settings,
        axes=parse_axes(vary or []),
        seeds=[1] if seeds is None else parse_seeds(seeds),
        sensors=None if sensors is None else read_sensors(sensors),
    )
    bar = console(stderr=True)
    runs = export_dataset(planned, workers=jobs, console=bar if bar.is_terminal else None, finished=_print)
    failed = sum(bool(run.error) and not run.is_excluded for run in runs)
    frames = sum(run.frames for run in runs)
    warned = Counter(warning for run in runs for warning in run.warnings)
    print_warnings(f"{warning} ({count} of {counted(len(runs), 'run')})" for warning, count in warned.items())
    kept = f", {len(planned) - len(runs)} already complete" if len(runs) < len(planned) else ""
    echo(f"{counted(len(runs), 'run')}, {counted(frames, 'frame')}{kept}; {in_one_line(out)}")
    raise typer.Exit(ABORTED if failed else PASSED)


def _print(run: ExportedRun) -> None:
    """Print the outcome of a run."""
    if run.error:
        echo(f"{run.name}: {'excluded' if run.is_excluded else 'failed'}: {run.error}", err=True)
        return
    echo(f"{run.name}: {counted(run.frames, 'frame')} of {counted(run.stations, 'station')}")


def _import(folder: Path, out: Path) -> None:
    """Write a scenario per recording of a folder."""
    from eidrive_scenario.export.dataset_import import import_recordings

    for path, warnings in import_recordings(folder, out):
        echo_path(path)
        print_warnings(f"{in_one_line(path.name)}: {warning}" for warning in warnings)
