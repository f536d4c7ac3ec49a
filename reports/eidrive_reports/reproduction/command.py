"""Command `eidrive reproduce`, which the engine finds by its entry point."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

_selection = partial(typer.Option, metavar="A,B", show_default=False)


def reproduce(
    parts: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="PART",
            help="table2, table3, detection, pipeline, ei, sensitivity, channels, perception, learned, all; benchmark.",
            show_default="all",
        ),
    ] = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=10_000,
            help="Episodes of each cell, with seeds from 1.",
            show_default="table2: 20, table3: 40, channels: 10, perception: 4, sensitivity: 3, learned: 2, else 5",
        ),
    ] = None,
    detectors: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Detectors of the stations.",
            show_default="the paper's; table3: oracle; perception: lidar; learned, benchmark: pillars",
        ),
    ] = None,
    fusion: Annotated[str | None, _selection(help="benchmark: methods, NAME[:DETECTOR].")] = None,
    channels: Annotated[str | None, _selection(help="benchmark: channel profiles, or RATEmbit_STATIONS.")] = None,
    scenarios: Annotated[str | None, _selection(help="benchmark: names, files, or families such as ncap.")] = None,
    out: Annotated[Path, typer.Option(help="Folder of the tables and of the records of all runs.")] = Path(
        "reports/paper"
    ),
    workers: Annotated[
        int | None, typer.Option(min=1, help="Number of processes.", show_default="number of cores")
    ] = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Repeat the runs of the record, too; without it they are kept.")
    ] = False,
    replays: Annotated[
        bool,
        typer.Option(
            "--replays", help="Also write a replay of each arm with seed 1 (table2, table3, detection, pipeline, ei)."
        ),
    ] = False,
) -> None:
    """Reproduce the experiments of the EI-Drive paper, and write reports with its numbers beside the measured ones.

    The part benchmark compares fusion methods by channel and scenario.

    Example: eidrive reproduce table2 --episodes 5 --out reports/paper
    """
    from rich.console import Console

    from eidrive_reports.reproduction import benchmark
    from eidrive_reports.reproduction.figures import draw
    from eidrive_reports.reproduction.page import write_benchmark_page, write_paper_page, write_part_replays
    from eidrive_reports.reproduction.parts import ALL, selected_detectors, selected_parts
    from eidrive_reports.reproduction.reproduce import reproduce as reproduce_part
    from eidrive_scenario.api.common import counted

    if str(out) == "-":
        raise typer.BadParameter("- is not a path", param_hint="--out")
    names = _names(detectors) or []
    given = {"fusion": _names(fusion), "channels": _names(channels), "scenarios": _names(scenarios)}
    sets = {option: texts for option, texts in given.items() if texts is not None}
    others = {}
    if benchmark.NAME in (parts or ()):
        others = {benchmark.NAME: benchmark.benchmark_part(names, **sets)}
    elif sets:
        raise typer.BadParameter(f"has an effect on the part {benchmark.NAME} only", param_hint=f"--{next(iter(sets))}")
    selected = selected_parts(parts or [ALL], others)
    chosen = [(part, selected_detectors(part, names)) for part in selected]
    for part, used in chosen:
        done = reproduce_part(
            part,
            out,
            episodes=episodes or part.episodes,
            detectors=used,
            workers=workers,
            restart=restart,
            console=Console(stderr=True),
        )
        draw(part.name, done.report, out)
        if replays and part.has_replays:
            written = write_part_replays(part, out, used, workers=workers, console=Console(stderr=True))
            typer.echo(f"{part.name}: wrote {written}")
        elif replays:
            typer.echo(f"{part.name}: --replays has no effect on this part", err=True)
        page = write_benchmark_page(out) if part.name == benchmark.NAME else write_paper_page(out)
        kept = len(done.episodes) - done.added
        typer.echo(
            f"{part.name}: {counted(done.added, 'run')} in {done.elapsed_s:.0f} s, {kept} from the record; all "
            f"{len(done.episodes)} took {done.computed_s:.0f} s of one process; wrote {out / part.name}.md and {page}"
        )
        if done.unused:
            typer.echo(f"{part.name}: {done.unused} runs of the record have other settings, seeds or code", err=True)


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",")]
