"""Comparisons of sweeps, and of values of an axis, as text, JSON, Markdown and a page."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import counted
from eidrive_scenario.experiments.statistics.intervals import exact_percentage, interval_text, percentage
from eidrive_scenario.experiments.sweeps.axes import text_of_value
from eidrive_scenario.experiments.sweeps.comparison import UNDECIDED, Comparison, NamedComparison
from eidrive_scenario.reporting.page import write_page

_EXPLANATION = (
    "Pairs are runs with equal scenario, seed and other values. Differences are those to the reference, with score "
    "intervals (Tango 1998). p is that of McNemar's exact test of equal success rates. Not worse: a decrease by "
    "{margin} or more is excluded with a confidence of {confidence}."
)


def text_lines(comparisons: Sequence[NamedComparison]) -> Iterator[str]:
    """Yield the lines of comparisons. Values of an axis have a line that names them A and B before each."""
    for number, named in enumerate(comparisons):
        if named.axis:
            if number:
                yield ""
            yield f"{named.axis}: A is {text_of_value(named.first)}, B is {text_of_value(named.second)}"
        if named.comparison is None:
            yield _no_pair(named, "B", "A")
        else:
            yield from _lines(named.comparison)


def _lines(comparison: Comparison) -> Iterator[str]:
    counts = comparison.verdicts
    first, second = comparison.rates
    confidence, margin = exact_percentage(comparison.confidence), exact_percentage(comparison.margin, 1)
    yield (
        f"{counted(counts.pairs, 'pair')} of runs with a verdict, {comparison.identical} with equal trace hashes; "
        f"{counted(comparison.unpaired, 'run')} without a partner"
    )
    yield (
        f"A passed {percentage(first)}, B passed {percentage(second)}; "
        f"only A passed in {counted(counts.only_first, 'pair')}, only B in {counts.only_second}"
    )
    yield (
        f"B - A: {_signed(counts.difference)} ({confidence}: {_limits(comparison)}); "
        f"McNemar's exact test: p = {comparison.p_value:.3g}"
    )
    for name, paired in comparison.metrics.items():
        interval, pairs = interval_text(paired.low, paired.high, "+.4g"), counted(paired.pairs, "pair")
        yield f"{name}: B - A {paired.mean:+.4g} ({confidence}: {interval}; {pairs})"
    if comparison.is_not_worse:
        yield f"B is not worse than A by {margin} or more (p = {comparison.p_worse:.3g})"
    elif comparison.is_worse:
        yield "B is worse than A"
    elif comparison.lost:
        yield f"undecided: B has no verdict of {counted(comparison.lost, 'run')} with a verdict in A; repeat by --retry"
    else:
        yield (
            f"undecided: the runs do not show that B is not worse by {margin} or more "
            f"(p = {comparison.p_worse:.3g}); more pairs, or a larger --margin"
        )


def _signed(difference: float) -> str:
    return percentage(difference, sign="+")


def _limits(comparison: Comparison) -> str:
    return " to ".join(map(_signed, comparison.interval))


def _no_pair(named: NamedComparison, second: str, first: str) -> str:
    """Return that no pair of runs has verdicts, with the outcomes of the runs of the second one."""
    counts = ", ".join(f"{count} {status}" for status, count in named.counts.items())
    return f"undecided: no run of {second} has a partner with a verdict in {first} (runs of {second}: {counts})"


def as_json(named: NamedComparison) -> dict[str, Any]:
    """Return a comparison as an object of JSON values; without a pair it has the numbers of runs by outcome."""
    names = {"axis": named.axis or None, "first": named.first, "second": named.second}
    comparison = named.comparison
    if comparison is None:
        return {**names, "pairs": 0, "runs": dict(named.counts), "conclusion": UNDECIDED}
    counts, (first, second), (low, high) = comparison.verdicts, comparison.rates, comparison.interval
    return {
        **names,
        "pairs": counts.pairs,
        "both_passed": counts.both,
        "only_first_passed": counts.only_first,
        "only_second_passed": counts.only_second,
        "none_passed": counts.neither,
        "unpaired": comparison.unpaired,
        "lost": comparison.lost,
        "identical": comparison.identical,
        "first_rate": first,
        "second_rate": second,
        "difference": counts.difference,
        "low": low,
        "high": high,
        "p_value": comparison.p_value,
        "p_worse": comparison.p_worse,
        "margin": comparison.margin,
        "confidence": comparison.confidence,
        "conclusion": comparison.conclusion,
        "metrics": {
            name: {
                "pairs": paired.pairs,
                "difference": paired.mean,
                "low": None if math.isnan(paired.low) else paired.low,
                "high": None if math.isnan(paired.high) else paired.high,
            }
            for name, paired in comparison.metrics.items()
        },
    }


@dataclass(frozen=True)
class _Row:
    """Row of a table: the second one of a comparison.

    cells  its texts in the columns after the name;  low, high, difference  of the success rates, for the bar
    """

    name: str
    cells: Sequence[str]
    conclusion: str
    remark: str
    bar: tuple[float, float, float] | None = None


def _table(comparisons: Sequence[NamedComparison]) -> tuple[list[str], list[_Row]]:
    """Return the titles of the columns after the conclusion, and the rows."""
    metrics = dict.fromkeys(name for named in comparisons if named.comparison for name in named.comparison.metrics)
    confidence = exact_percentage(_compared(comparisons).confidence)
    columns = ["pairs", "reference passed", "passed", "only reference passed", "only this passed"]
    columns += [f"difference ({confidence})", "p", *(f"{name}, difference ({confidence})" for name in metrics)]
    rows = []
    for named in comparisons:
        comparison, name = named.comparison, text_of_value(named.second)
        if comparison is None:
            cells = ["0"] + [""] * (len(columns) - 1)
            rows.append(_Row(name, cells, UNDECIDED, _no_pair(named, name, text_of_value(named.first))))
            continue
        counts, (low, high), (first, second) = comparison.verdicts, comparison.interval, comparison.rates
        remark = f"{name}: no verdict of {counted(comparison.lost, 'run')} with a verdict of the reference"
        cells = [
            str(counts.pairs),
            percentage(first),
            percentage(second),
            str(counts.only_first),
            str(counts.only_second),
            f"{_signed(counts.difference)} ({_limits(comparison)})",
            f"{comparison.p_value:.3g}",
            *(
                f"{paired.mean:+.4g} ({interval_text(paired.low, paired.high, '+.4g')})" if paired is not None else ""
                for paired in map(comparison.metrics.get, metrics)
            ),
        ]
        bar = low, high, counts.difference
        rows.append(_Row(name, cells, comparison.conclusion, remark if comparison.lost else "", bar))
    return columns, rows


def _compared(comparisons: Sequence[NamedComparison]) -> Comparison:
    """Return the first comparison with pairs; there is one."""
    return next(named.comparison for named in comparisons if named.comparison is not None)


def as_markdown(comparisons: Sequence[NamedComparison]) -> str:
    """Return comparisons as a table of GitHub Flavored Markdown; texts of users are code, so that none is markup."""
    axis, reference = comparisons[0].axis, text_of_value(comparisons[0].first)
    titles, rows = _table(comparisons)
    columns = [_code(axis) if axis else "store", "conclusion", *map(_cell, titles)]
    lines = [
        f"### {f'{_code(axis)} compared' if axis else 'Comparison'} with {_code(reference)}",
        "",
        f"| {' | '.join(columns)} |",
        f"|---|---|{'---:|' * (len(columns) - 2)}",
    ]
    lines += [f"| {' | '.join([_code(row.name), f'**{row.conclusion}**', *row.cells])} |" for row in rows]
    lines += [f"\n{_cell(row.remark)}" for row in rows if row.remark]
    return "\n".join([*lines, "", f"<sub>{_explanation(comparisons)}</sub>"])


def _explanation(comparisons: Sequence[NamedComparison]) -> str:
    comparison = _compared(comparisons)
    margin, confidence = exact_percentage(comparison.margin, 1), exact_percentage(comparison.confidence)
    return _EXPLANATION.format(margin=margin, confidence=confidence)


def _code(text: str) -> str:
    """Return a text as code in a table: one line, with a fence that it does not contain, and escaped bars."""
    line = " ".join(text.split()) or " "
    fence = "`" * (max(map(len, re.findall("`+", line)), default=0) + 1)
    padding = " " if "`" in line else ""
    return f"{fence}{padding}{line}{padding}{fence}".replace("|", r"\|")


def _cell(text: str) -> str:
    """Return a text outside of code, in which no character is markup."""
    return re.sub(r"([\\`*_\[\]<>|~@#&])", r"\\\1", " ".join(text.split()))


def write_comparison(comparisons: Sequence[NamedComparison], out: Path) -> Path:
    """Write comparisons as a page, and return its path. Raise SettingError if it cannot be written."""
    axis, (columns, rows) = comparisons[0].axis, _table(comparisons)
    return write_page(
        out,
        "comparison.html.jinja",
        title=f"Comparison of {axis}" if axis else "Comparison of two sweeps",
        subject=axis or "store",
        reference=text_of_value(comparisons[0].first),
        columns=columns,
        rows=rows,
        explanation=_explanation(comparisons),
        footer=f"eidrive-scenario {version('eidrive-scenario')}",
    )
