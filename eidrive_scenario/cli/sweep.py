"""Commands `eidrive sweep` and `eidrive results`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.added_options import AllowTorchscript, Controllers, Keep, NoCriteria, UserValues
from eidrive_scenario.cli.error_output import print_warnings
from eidrive_scenario.cli.interruption import interrupt_once
from eidrive_scenario.cli.option_values import check_seconds, parse_assignments, parse_seeds, parse_shard
from eidrive_scenario.cli.output_paths import check_output_paths
from eidrive_scenario.cli.short_help import HelpAll, rare
from eidrive_scenario.cli.streams import echo
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.exit_codes import ABORTED, NOT_JUDGED, PASSED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from eidrive_scenario.experiments.sweeps.axes import Axis
    from eidrive_scenario.experiments.sweeps.results import PointSummary
    from eidrive_scenario.experiments.sweeps.sweep import SweepProgress

USUAL_LIMIT = 1800.0
"""Default maximum wall time of a run [s]."""
REASONS = 3
"""Number of printed reasons of runs without a verdict."""


def sweep(
    scenario: Annotated[str, typer.Argument(help="An .xosc file or a library name; all runs of a distribution.")],
    store: Annotated[Path, typer.Option(help="SQLite file of results, which is continued.")],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="Parameter, channel, channel.KEY, detector, planner, weather or cooperate (A+B), over "
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
    channel: Annotated[str | None, typer.Option(help="Channel profile of all runs.", show_default=False)] = None,
    param: Annotated[list[str] | None, typer.Option(metavar="K=V", help="Parameter of all runs; repeatable.")] = None,
    drive: Annotated[
        list[str] | None, rare(metavar="NAME[=STACK]", help="Give entity NAME a driving stack, as in `eidrive run`.")
    ] = None,
    user_value: UserValues = None,
    controller: Controllers = None,
    criterion: Annotated[list[str] | None, rare(metavar="YAML|FILE", help="Add criteria; repeatable.")] = None,
    no_criteria: NoCriteria = False,
    time_limit: Annotated[float, rare(help="Maximum simulated time in seconds.")] = 120.0,
    out: Annotated[
        Path | None, typer.Option(help="Folder of a subfolder per run: recording, result.json.", show_default="none")
    ] = None,
    record: Annotated[
        Keep | None, rare(help="Runs whose recording and images --out keeps.", show_default="always")
    ] = None,
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
    allow_torchscript: AllowTorchscript = False,
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

    from eidrive_scenario.cli.sweep_progress import ProgressDisplay
    from eidrive_scenario.cli.sweep_search import Search, check_search_options
    from eidrive_scenario.experiments.repetitions import cores
    from eidrive_scenario.experiments.run_folder import check_writable
    from eidrive_scenario.experiments.sweeps.axes import parse_axes, parse_axis, points_of, with_types
    from eidrive_scenario.experiments.sweeps.cluster import DaskWorkers
    from eidrive_scenario.experiments.sweeps.jobs import Shard, plan_of, versions
    from eidrive_scenario.experiments.sweeps.searches import BATCH
    from eidrive_scenario.experiments.sweeps.store import ResultStore
    from eidrive_scenario.experiments.sweeps.sweep import run_sweep
    from eidrive_scenario.experiments.sweeps.workers import KeptFiles, LocalWorkers, Workers
    from eidrive_scenario.library import definition, resolve_scenario
    from eidrive_scenario.simulation import RunSettings
    from eidrive_scenario.simulation.added_settings import parse_drive

    for option, value in (("--time-limit", time_limit), ("--wall-limit", wall_limit)):
        check_seconds(option, value)
    if record is not None and out is None:
        raise SettingError(Diagnostic("--record without --out has no effect", "add --out DIR"))
    files = None if out is None else KeptFiles(out.absolute(), (record or Keep.always).value, store.absolute())
    path = resolve_scenario(scenario)
    settings = RunSettings(
        channel=channel,
        parameters=parse_assignments("--param", param or []),
        user_values=parse_assignments("--user-value", user_value or []),
        controllers=parse_assignments("--controller", controller or []),
        drive=parse_drive("--drive", drive or []),
        criteria=criterion,
        time_limit=time_limit,
        allow_torchscript=allow_torchscript,
        no_criteria=no_criteria,
    )
    chosen = None if seeds is None else parse_seeds("--seeds", seeds)
    kind = definition(path)

    def typed(axes: Sequence[Axis]) -> tuple[Axis, ...]:
        return with_types(axes, path, is_distribution=kind == "distribution")

    axes = typed(parse_axes(vary or []))
    search = None
    check_search_options(find_boundary is not None, falsify, bound, tolerance, objective)
    if falsify or find_boundary is not None:
        (boundary,) = (None,) if find_boundary is None else typed([parse_axis(find_boundary)])
        search = Search.of(axes, boundary, bound, tolerance, falsify, objective, runs, chosen)
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
    if dry_run:
        echo(f"{len(jobs)} runs of {scenario}: {len(plan.points)} combinations, {len(plan.seeds)} seeds each")
        for point in plan.points[:10]:
            echo("  " + (", ".join(f"{name}={value}" for name, value in point.items()) or "no axis"))
        if len(plan.points) > 10:
            echo(f"  and {len(plan.points) - 10} more")
        raise typer.Exit
    if out is not None:
        check_writable(out)
    with interrupt_once(), ResultStore.open(store, versions()) as opened:
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
    echo(f"{progress.done} runs in {progress.elapsed_s:.1f} s{f': {counts}' if counts else ''}{kept}; {store}")
    count, command = progress.warned
    if count:
        print_warnings([describe_warned(count, progress.done, command)])
    for (status, message), count in progress.errors.most_common(REASONS):
        echo(f"{count} {status}: {message}", err=True)
    if not progress.is_complete:
        echo(f"all runs without a verdict: eidrive results {shlex.quote(str(store))} --failures", err=True)


def results(
    stores: Annotated[list[Path], typer.Argument(metavar="STORE...", help="Stores of sweeps; shards are combined.")],
    by: Annotated[str | None, typer.Option(metavar="A,B", help="Axes of the table.", show_default="all")] = None,
    interval: Annotated[str, typer.Option(help="anytime (valid while runs are added), wilson or exact.")] = "anytime",
    confidence: Annotated[float, typer.Option(help="Confidence of the intervals.")] = 0.95,
    csv: Annotated[Path | None, typer.Option(help="Write one row per run as CSV.")] = None,
    parquet: Annotated[Path | None, typer.Option(help="Write one row per run as Parquet.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object per combination.")] = False,
    failures: Annotated[bool, typer.Option("--failures", help="Print the commands of runs that did not pass.")] = False,
) -> None:
    """Print the success rates of a sweep by combination of values, and export its runs.

    Example: eidrive results s.db --by channel.delay.seconds --csv runs.csv
    """
    import json as json_text

    from eidrive_scenario.experiments.sweeps.results import (
        indistinct,
        mixed_versions,
        stored_runs,
        summaries,
        warned,
        write_csv,
        write_parquet,
    )
    from eidrive_scenario.experiments.sweeps.store import PASSED as PASSED_RUN

    if not 0.0 < confidence < 1.0:
        raise SettingError(Diagnostic(f"--confidence is {confidence}", "give a number between 0 and 1"))
    check_output_paths({"--csv": csv, "--parquet": parquet}, stores)
    found = list(stored_runs(stores))
    names = None if by is None else [name.strip() for name in by.split(",")]
    rows = summaries(found, by=names, interval=interval, confidence=confidence)
    mixed = (indistinct(found), mixed_versions(found))
    warnings = (*(f"{one}; a new store keeps them apart" for one in mixed if one), warned(found))
    print_warnings([warning for warning in warnings if warning])
    if csv is not None:
        write_csv(found, csv)
    if parquet is not None:
        write_parquet(found, parquet)
    if json:
        for row in rows:
            echo(json_text.dumps(_as_json(row)))
    elif failures:
        for run in found:
            if run.status != PASSED_RUN:
                echo(f"{run.status}: {run.command or f'{run.scenario}, run {run.run}, seed {run.seed}'}")
                if run.error:
                    echo("  " + run.error.replace("\n", "\n  "))
    else:
        _print_table(rows, interval, confidence)


def _as_json(row: PointSummary) -> dict[str, object]:
    rate = row.rate
    limits = {} if rate is None else {"success_rate": rate.share, "low": rate.low, "high": rate.high}
    return {"point": dict(row.point), "runs": dict(row.counts), **limits}


def _print_table(rows: Sequence[PointSummary], interval: str, confidence: float) -> None:
    from rich.table import Table

    from eidrive_scenario.cli.verdicts import console

    axes = list(dict.fromkeys(name for row in rows for name in row.point))
    statuses = [
        status for status in dict.fromkeys(status for row in rows for status in row.counts) if status != "passed"
    ]
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in axes:
        table.add_column(name, overflow="fold")
    for name in ("runs", "passed", *statuses, "success rate", f"{confidence:.0%} {interval}"):
        table.add_column(name, justify="right")
    for row in rows:
        rate = row.rate
        table.add_row(
            *(_short(row.point.get(name, "")) for name in axes),
            str(sum(row.counts.values())),
            str(row.counts.get("passed", 0)),
            *(str(row.counts.get(status, 0)) for status in statuses),
            "" if rate is None else f"{rate.share:.1%}",
            "" if rate is None else f"{rate.low:.1%} to {rate.high:.1%}",
        )
    out = console()
    if not out.is_terminal:  # lines as long as necessary, so that other programs can read them
        out.width = max(200, 40 * len(table.columns))
    out.print(table)


def _short(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
