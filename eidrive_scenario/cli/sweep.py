"""Command `eidrive sweep`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.options import (
    HelpAll,
    Record,
    check_output_paths,
    check_record,
    parse_seeds,
    parse_shard,
    rare,
    takes_run_options,
)
from eidrive_scenario.cli.output import echo, print_warnings
from eidrive_scenario.errors import ABORTED, NOT_JUDGED, PASSED, Diagnostic, SettingError, counted
from eidrive_scenario.recording.run_files import RecordMode
from eidrive_scenario.run_options import RunSettings, check_seconds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from eidrive_scenario.experiments.sweeps.axes import Axis
    from eidrive_scenario.experiments.sweeps.sweep import SweepProgress

USUAL_LIMIT = 1800.0
"""Default maximum wall time of a run [s]."""
REASONS = 3
"""Number of printed reasons of runs without a verdict."""


@takes_run_options(
    "sweep",
    at="out",
    before={"drive": "user_values", "no_criteria": "time_limit", "allow_torchscript": "retry"},
)
def sweep(
    settings: RunSettings,
    scenario: Annotated[str, typer.Argument(help="An .xosc file or a library name; all runs of a distribution.")],
    store: Annotated[
        Path | None,
        typer.Option(help="SQLite file of results, which is continued.", show_default="required but for --dry-run"),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="Parameter, channel, channel.KEY, detector, fusion, planner, weather or cooperate (A+B), over "
            "A,B, LOW:HIGH:STEP or LOW:HIGH; repeatable.",
        ),
    ] = None,
    design: Annotated[str, typer.Option(help="grid, lhs (Latin hypercube) or sobol.")] = "grid",
    samples: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Combinations of lhs or sobol.", show_default="none")
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(metavar="A-B|A,B", help="Seeds of each combination.", show_default="1")
    ] = None,
    runs: Annotated[int | None, rare(min=1, help="Total number of runs.", show_default="all")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of a subfolder per run: recording, result.json.", show_default="none")
    ] = None,
    record: Record = None,
    wall_limit: Annotated[float, rare(help="Maximum wall time of each run in seconds.")] = USUAL_LIMIT,
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processes.", show_default="number of cores")
    ] = None,
    scheduler: Annotated[
        str | None,
        rare(metavar="ADDRESS|slurm|kubernetes", help="Dask cluster.", show_default="processes"),
    ] = None,
    shard: Annotated[
        str | None,
        rare(metavar="I/N", help="Part I of N, for job arrays; a store for each."),
    ] = None,
    find_boundary: Annotated[
        str | None,
        typer.Option(metavar="NAME=LOW:HIGH", help="Find the value at which the success rate crosses --bound."),
    ] = None,
    bound: Annotated[float | None, rare(help="Success rate of --find-boundary.", show_default="0.5")] = None,
    tolerance: Annotated[
        float | None,
        rare(help="Accuracy of --find-boundary.", show_default="2 % of the range"),
    ] = None,
    falsify: Annotated[
        bool, typer.Option("--falsify", help="Search the space of --vary for different failures.")
    ] = False,
    objective: Annotated[
        str | None,
        rare(metavar="METRIC", help="Metric that --falsify minimizes instead of margins."),
    ] = None,
    retry: Annotated[bool, rare("--retry", help="Repeat aborted and crashed runs of the store.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would run.")] = False,
    help_all: HelpAll = False,
) -> None:
    """Run a scenario over parameters, settings and seeds; a killed sweep continues with the same command.

    Example: eidrive sweep coop/scenario_1 --vary channel.delay.seconds=0:1:0.1 --store s.db
    """
    from eidrive_scenario.experiments.sweeps.workers import start_server

    if scheduler is None and not dry_run:
        start_server()  # First, as it imports for as long as the imports below

    from eidrive_scenario.base.content_digest import package_versions
    from eidrive_scenario.cli.sweep_search import ProgressDisplay, Search
    from eidrive_scenario.experiments.repetitions import cores, interrupt_once
    from eidrive_scenario.experiments.run_folder import check_writable
    from eidrive_scenario.experiments.sweeps.axes import parse_axes, parse_axis, points_of, with_types
    from eidrive_scenario.experiments.sweeps.cluster import DaskWorkers
    from eidrive_scenario.experiments.sweeps.jobs import Shard, plan_of
    from eidrive_scenario.experiments.sweeps.searches import BATCH
    from eidrive_scenario.experiments.sweeps.store import ResultStore
    from eidrive_scenario.experiments.sweeps.sweep import run_sweep
    from eidrive_scenario.experiments.sweeps.workers import KeptFiles, LocalWorkers, Workers
    from eidrive_scenario.extensions.library import definition, resolve_scenario

    check_seconds("--wall-limit", wall_limit)
    check_record(record, out)
    path = resolve_scenario(scenario)
    check_output_paths({"--store": store, "--out": out}, [path, *settings.sources])
    chosen = None if seeds is None else parse_seeds(seeds)
    kind = definition(path)

    def typed(axes: Sequence[Axis]) -> tuple[Axis, ...]:
        return with_types(axes, path, is_distribution=kind == "distribution")

    axes = typed(parse_axes(vary or []))
    boundary = None if find_boundary is None else typed([parse_axis(find_boundary, "--find-boundary")])[0]
    search = Search.of(axes, boundary, bound, tolerance, falsify, objective, runs, chosen)
    if search is not None:
        axes, runs, chosen = search.fixed, None, chosen or [1]
        if shard is not None or design != "grid":
            raise SettingError(Diagnostic("a search has neither shards nor a design", "remove --shard and --design"))
    points = points_of(axes, design, samples, seed=1)
    plan = plan_of(
        path,
        points,
        settings,
        seeds=chosen,
        runs=runs,
        space=() if search is None else search.axes,
        is_distribution=kind == "distribution",
    )
    jobs = Shard(plan, *((1, 1) if shard is None else parse_shard(shard)))
    if search is not None:
        search.check(plan)
    if dry_run and search is not None:
        axes = search.axes + search.fixed
        echo(f"at most {counted(search.runs, 'run')} of {scenario}: search over {', '.join(map(str, axes))}")
        raise typer.Exit
    if dry_run:
        echo(
            f"{counted(len(jobs), 'run')} of {scenario}: {counted(len(plan.points), 'combination')}, "
            f"{counted(len(plan.seeds), 'seed')} each"
        )
        for point in plan.points[:10]:
            echo("  " + (", ".join(f"{name}={value}" for name, value in point.items()) or "no axis"))
        if len(plan.points) > 10:
            echo(f"  and {len(plan.points) - 10} more")
        raise typer.Exit
    if store is None:
        raise SettingError(Diagnostic("--store is missing", "give the SQLite file of the results, or --dry-run"))
    files = None if out is None else KeptFiles(out.absolute(), record or RecordMode.ALWAYS, store.absolute())
    if out is not None:
        check_writable(out)
    with interrupt_once(), ResultStore.open(store, package_versions()) as opened:
        crew: Workers
        if scheduler is None:
            crew = LocalWorkers(min(workers or cores(), len(jobs) if search is None else BATCH))
        else:
            crew = DaskWorkers.connect(scheduler, workers)
        try:
            if search is not None:
                search.run(plan, opened, crew, wall_limit=wall_limit, retry=retry, files=files)
                raise typer.Exit
            with ProgressDisplay(len(jobs)) as display:
                progress = run_sweep(
                    jobs, opened, crew, wall_limit=wall_limit, retry=retry, files=files, shown=display.show
                )
        finally:
            crew.close()
    _print_summary(progress, store)
    raise typer.Exit(PASSED if progress.is_complete else NOT_JUDGED if progress.lacks_criteria_only else ABORTED)


def _print_summary(progress: SweepProgress, store: Path) -> None:
    """Print the number of runs by status, that of runs with warnings, and the most frequent reasons of runs without a
    verdict."""
    from eidrive_scenario.experiments.sweeps.results import describe_warned

    counts = ", ".join(f"{count} {status}" for status, count in sorted(progress.counts.items()))
    stored = ", ".join(f"{count} {status}" for status, count in sorted(progress.stored.items()))
    kept = f", {progress.kept} already in the store ({stored})" if stored else ""
    echo(
        f"{counted(progress.done, 'run')} in {progress.elapsed_s:.1f} s{f': {counts}' if counts else ''}{kept}; {store}"
    )
    count, command = progress.warned
    if count:
        print_warnings([describe_warned(count, progress.done, command)])
    for (status, message), count in progress.errors.most_common(REASONS):
        echo(f"{count} {status}: {message}", err=True)
    if not progress.is_complete:
        echo(f"all runs without a verdict: eidrive results {shlex.quote(str(store))} --failures", err=True)
