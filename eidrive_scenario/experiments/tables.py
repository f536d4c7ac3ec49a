"""Table of the paper on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box as boxes
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table as Grid
from rich.text import Text

from eidrive_scenario.experiments.paper import SCENARIOS, Cell, PublishedClaim, Table

HEADINGS = (
    "arm",
    "centers [m]\nmean ± sd",
    "\nmin",
    "boxes\nmean",
    "[m]\nmin",
    "collision-free\nk/n       95 %",
    "paper [m]\nmean ± sd",
)


def row(cell: Cell) -> tuple[str, ...]:
    """Return one row of the table in the order of HEADINGS, with the population standard deviation of the paper."""
    center, box, free = cell.center, cell.box, cell.collision_free
    return (
        cell.arm.title,
        f"{center.mean:.2f} ± {center.population_sd:.2f}",
        f"{center.smallest:.2f}",
        f"{box.mean:.2f}",
        f"{box.smallest:.2f}",
        f"{free.successes}/{free.trials} {free.low:.2f}-{free.high:.2f}",
        f"{cell.published.mean:.2f} ± {cell.published.sd:.2f}",
    )


def render(table: Table, found: Sequence[PublishedClaim] = ()) -> RenderableType:
    """Return one grid per scenario, followed by the checks of the published order."""
    parts: list[RenderableType] = [Text(f"Table II, oracle; {table.variant.title}", style="bold"), Text("")]
    for scenario in table.scenarios:
        grid = Grid(
            title=SCENARIOS.get(scenario, scenario),
            title_justify="left",
            title_style="bold",
            box=boxes.SIMPLE_HEAD,
            show_edge=False,
            padding=(0, 1, 0, 0),
        )
        for index, heading in enumerate(HEADINGS):
            grid.add_column(heading, justify="left" if index == 0 else "right", no_wrap=True)
        for cell in (cell for cell in table.cells if cell.scenario == scenario):
            grid.add_row(*row(cell))
        parts.append(grid)
        parts.extend(_lines(check) for check in found if check.scenario == scenario)
        parts.append(Text(""))
    return Group(*parts)


def _lines(check: PublishedClaim) -> RenderableType:
    verdict = ("holds: ", "green") if check.holds else ("does not hold: ", "red")
    return Group(Text.assemble(verdict, check.statement), Padding(Text(check.evidence, style="dim"), (0, 0, 0, 4)))
