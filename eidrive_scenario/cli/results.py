"""Commands `eidrive results` and `eidrive compare`: results of finished sweeps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.options import check_output_paths
from eidrive_scenario.cli.output import echo, echo_path, print_warning, print_warnings
from eidrive_scenario.errors import FAILED, PASSED, Diagnostic, SettingError

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    from eidrive_scenario.recording.run_files import result_paths

    if not 0.0 < confidence < 1.0:
        raise SettingError(Diagnostic(f"--confidence is {confidence}", "give a number between 0 and 1"))
    if json and failures:
        raise SettingError(Diagnostic("--json and --failures exclude each other", "give one of them"))
    check_output_paths({"--csv": csv, "--parquet": parquet}, result_paths(stores))
    runs = list(stored_runs(stores, print_warning))
    names = None if by is None else [name.strip() for name in by.split(",")]
    points = summaries(runs, by=names, interval=interval, confidence=confidence)
    mixed = (indistinct(runs), mixed_versions(runs))
    warnings = (*(f"{text}; a new store or folder keeps them apart" for text in mixed if text), warned(runs))
    print_warnings([warning for warning in warnings if warning])
    if csv is not None:
        write_csv(runs, csv)
    if parquet is not None:
        write_parquet(runs, parquet)
    if json:
        for point in points:
            echo(json_text.dumps(_as_json(point)))
    elif failures:
        for run in runs:
            if run.status != PASSED_RUN:
                echo(f"{run.status}: {run.command or f'{run.scenario}, run {run.run}, seed {run.seed}'}")
                if run.error:
                    echo("  " + run.error.replace("\n", "\n  "))
    else:
        _print_table(points, interval, confidence)


def _as_json(summary: PointSummary) -> dict[str, object]:
    rate = summary.rate
    limits = {} if rate is None else {"success_rate": rate.share, "low": rate.low, "high": rate.high}
    return {"point": dict(summary.point), "runs": dict(summary.counts), **limits}


def _print_table(summaries: Sequence[PointSummary], interval: str, confidence: float) -> None:
    from rich.table import Table

    from eidrive_scenario.cli.console import console
    from eidrive_scenario.experiments.statistics.intervals import exact_percentage, percentage

    axes = list(dict.fromkeys(name for summary in summaries for name in summary.point))
    counted = dict.fromkeys(status for summary in summaries for status in summary.counts)
    statuses = [status for status in counted if status != "passed"]
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in axes:
        table.add_column(name, overflow="fold")
    for name in ("runs", "passed", *statuses, "success rate", f"{exact_percentage(confidence)} {interval}"):
        table.add_column(name, justify="right")
    for summary in summaries:
        rate = summary.rate
        table.add_row(
            *(_short(summary.point.get(name, "")) for name in axes),
            str(sum(summary.counts.values())),
            str(summary.counts.get("passed", 0)),
            *(str(summary.counts.get(status, 0)) for status in statuses),
            "" if rate is None else percentage(rate.share),
            "" if rate is None else f"{percentage(rate.low)} to {percentage(rate.high)}",
        )
    out = console()
    if not out.is_terminal:  # lines as long as necessary, so that other programs can read them
        out.width = max(200, 40 * len(table.columns))
    out.print(table)


def _short(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def compare(
    stores: Annotated[
        list[Path],
        typer.Argument(metavar="STORE_A STORE_B", help="Stores, the reference first; folders of results, too."),
    ],
    between: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[=A,B]",
            help="Compare values of this axis of one store instead: each one with the first.",
            show_default="none",
        ),
    ] = None,
    margin: Annotated[
        float, typer.Option(help="Largest decrease of the success rate that counts as not worse.")
    ] = 0.05,
    confidence: Annotated[float, typer.Option(help="Confidence of the decision and of the intervals.")] = 0.95,
    metric: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Metric whose means are compared; repeatable.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object per comparison.")] = False,
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print a table in Markdown, such as for a pull request.")
    ] = False,
    html: Annotated[Path | None, typer.Option(metavar="FILE", help="Write an HTML page.")] = None,
) -> None:
    """Compare two sweeps, or the values of an axis of one, in pairs with equal seeds.

    Example: eidrive compare release-1.db release-2.db --margin 0.02

    Values of an axis: eidrive compare s.db --between fusion. Exit code 0 if all are shown to be not worse than the
    first, else 1.
    """
    import json as json_text

    from eidrive_scenario.experiments.sweeps.comparison import NOT_WORSE, NamedComparison, compare_values
    from eidrive_scenario.experiments.sweeps.comparison import compare as compare_stores
    from eidrive_scenario.recording.run_files import result_paths
    from eidrive_scenario.reporting.comparison import as_json, as_markdown, text_lines, write_comparison

    if not 0.0 <= margin < 1.0:
        raise SettingError(Diagnostic(f"--margin is {margin}", "give a number from 0 to below 1"))
    if not 0.5 < confidence < 1.0:
        raise SettingError(Diagnostic(f"--confidence is {confidence}", "give a number between 0.5 and 1"))
    if json and markdown:
        raise SettingError(Diagnostic("--json and --markdown exclude each other", "give one of them"))
    check_output_paths({"--html": html}, result_paths(stores))
    if between is not None:
        name, equals, listed = between.partition("=")
        values = [text.strip() for text in listed.split(",")] if equals else []
        comparisons = compare_values(
            stores,
            name.strip(),
            values,
            margin=margin,
            confidence=confidence,
            metrics=metric or [],
            warn=print_warning,
        )
    elif len(stores) == 2:
        first, second = stores
        compared = compare_stores(
            [first], [second], margin=margin, confidence=confidence, metrics=metric or [], warn=print_warning
        )
        comparisons = [NamedComparison("", str(first), str(second), compared)]
    else:
        hint = "give two, or --between NAME, such as --between channel, for the values of an axis"
        raise SettingError(Diagnostic(f"the number of stores is {len(stores)}", hint))
    if json:
        for named in comparisons:
            echo(json_text.dumps(as_json(named)))
    elif markdown:
        echo(as_markdown(comparisons))
    else:
        for line in text_lines(comparisons):
            echo(line)
    if html is not None:
        write_comparison(comparisons, html)
        echo_path(html, err=json or markdown)
    is_not_worse = all(
        named.comparison is not None and named.comparison.conclusion == NOT_WORSE for named in comparisons
    )
    raise typer.Exit(PASSED if is_not_worse else FAILED)
