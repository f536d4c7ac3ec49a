"""Commands `eidrive results` and `eidrive compare`: results of finished sweeps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.options import (
    check_output_paths,
)
from eidrive_scenario.cli.output import echo, print_warnings
from eidrive_scenario.errors import FAILED, PASSED, Diagnostic, SettingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from eidrive_scenario.experiments.sweeps.comparison import Comparison
    from eidrive_scenario.experiments.sweeps.results import PointSummary


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

    from eidrive_scenario.cli.console import console

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


def compare(
    first: Annotated[Path, typer.Argument(metavar="STORE_A", help="Store of the reference, such as a release.")],
    second: Annotated[Path, typer.Argument(metavar="STORE_B", help="Store that is compared with it.")],
    margin: Annotated[
        float, typer.Option(help="Largest decrease of the success rate that counts as not worse.")
    ] = 0.05,
    confidence: Annotated[float, typer.Option(help="Confidence of the decision and of the intervals.")] = 0.95,
    metric: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Metric whose means are compared; repeatable.")
    ] = None,
) -> None:
    """Compare two sweeps of the same runs: exit code 0 if B is shown to be not worse than A, else 1.

    Example: eidrive compare release-1.db release-2.db --margin 0.02
    """
    from eidrive_scenario.experiments.sweeps.comparison import compare as compare_stores

    if not 0.0 <= margin < 1.0:
        raise SettingError(Diagnostic(f"--margin is {margin}", "give a number from 0 to below 1"))
    if not 0.5 < confidence < 1.0:
        raise SettingError(Diagnostic(f"--confidence is {confidence}", "give a number between 0.5 and 1"))
    found = compare_stores([first], [second], margin=margin, confidence=confidence, metrics=metric or [])
    for line in lines_of(found):
        echo(line)
    raise typer.Exit(PASSED if found.is_not_worse else FAILED)


def lines_of(found: Comparison) -> list[str]:
    """Return the comparison as text."""
    from eidrive_scenario.experiments.statistics.intervals import interval_text

    counts, pairs = found.verdicts, found.verdicts.pairs
    rates = [(counts.both + only) / pairs for only in (counts.only_first, counts.only_second)]
    low, high = found.interval
    lines = [
        f"{pairs} pairs of runs with a verdict, {found.identical} with equal trace hashes; "
        f"{found.unpaired} runs without a partner",
        f"A passed {rates[0]:.1%}, B passed {rates[1]:.1%}; "
        f"only A passed in {counts.only_first} pairs, only B in {counts.only_second}",
        f"B - A: {counts.difference:+.1%} ({found.confidence:.0%}: {low:+.1%} to {high:+.1%}); "
        f"McNemar's exact test: p = {found.p_value:.3g}",
    ]
    for name, one in found.metrics.items():
        interval = interval_text(one.low, one.high, "+.4g")
        lines.append(f"{name}: B - A {one.mean:+.4g} ({found.confidence:.0%}: {interval}; {one.pairs} pairs)")
    if found.is_not_worse:
        lines.append(f"B is not worse than A by {found.margin:.1%} or more (p = {found.p_worse:.3g})")
    elif found.is_worse:
        lines.append("B is worse than A")
    elif found.lost:
        lines.append(f"undecided: B has no verdict of {found.lost} runs with a verdict in A; repeat them by --retry")
    else:
        lines.append(
            f"undecided: the runs do not show that B is not worse by {found.margin:.1%} or more "
            f"(p = {found.p_worse:.3g}); more pairs, or a larger --margin"
        )
    return lines
