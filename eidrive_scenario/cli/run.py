"""`eidrive run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.errors import Problem, SettingError

if TYPE_CHECKING:
    pass


def run(
    scenario: Annotated[str, typer.Argument(help="An .xosc file, or a name of the library such as coop/scenario_1.")],
    channel: Annotated[
        str | None,
        typer.Option(help="Channel profile, by name or file; none: no cooperation.", show_default="the file's"),
    ] = None,
    detector: Annotated[str | None, typer.Option(help="Detector of all stations.", show_default="the file's")] = None,
    cooperate: Annotated[
        str | None, typer.Option(metavar="A,B|none", help="The senders that are heard.", show_default="the file's")
    ] = None,
    param: Annotated[
        list[str] | None, typer.Option(metavar="K=V", help="Value of a parameter of the scenario; repeatable.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of all randomness.")] = 1,
    repeat: Annotated[int, typer.Option(min=1, help="Number of runs, with seeds from --seed on.")] = 1,
    dt: Annotated[float, typer.Option(help="Step, in seconds.")] = 0.05,
    time_limit: Annotated[float, typer.Option(help="Longest simulated time, in seconds.")] = 120.0,
    out: Annotated[Path | None, typer.Option(help="Folder for recording.mcap and result.json.")] = None,
    no_record: Annotated[bool, typer.Option("--no-record", help="Leave out recording.mcap.")] = False,
    csv: Annotated[Path | None, typer.Option(help="File for one row per actor and tick.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object per run, nothing else.")] = False,
) -> None:
    """Play a scenario and judge it."""
    from eidrive_scenario.cli.verdicts import show
    from eidrive_scenario.experiments.single_run import as_json_text, play
    from eidrive_scenario.simulation import RunSettings

    settings = RunSettings(
        channel=channel,
        detector=detector,
        cooperate=_senders(cooperate),
        parameters=_parameters(param or []),
        dt=_positive("--dt", dt),
        time_limit=_positive("--time-limit", time_limit),
    )
    code = 0
    for each in range(seed, seed + repeat):
        mark = f"seed-{each}" if repeat > 1 else ""
        result = play(
            scenario,
            seed=each,
            settings=settings,
            out=out / mark if out is not None else None,
            record=not no_record,
            csv=csv.with_stem(f"{csv.stem}-{mark}") if csv is not None and mark else csv,
        )
        if json:
            typer.echo(as_json_text(result))
        else:
            show(result)
        code = max(code, result.exit_code)
    raise typer.Exit(code)


def _senders(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    return () if text == "none" else tuple(name.strip() for name in text.split(",") if name.strip())


def _parameters(assignments: list[str]) -> dict[str, str]:
    parameters = {}
    for assignment in assignments:
        name, equals, value = assignment.partition("=")
        if not equals or not name:
            raise SettingError(Problem(f"--param {assignment!r} assigns nothing", "write --param NAME=VALUE"))
        parameters[name] = value
    return parameters


def _positive(option: str, value: float) -> float:
    if not 0 < value < float("inf"):
        raise SettingError(Problem(f"{option} is {value}", "give a positive number of seconds"))
    return value
