"""Command `eidrive compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.streams import echo
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.exit_codes import FAILED, PASSED

if TYPE_CHECKING:
    from eidrive_scenario.experiments.sweeps.comparison import Comparison


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
