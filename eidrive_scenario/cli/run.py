"""Command `eidrive run`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.added_options import (
    AllowTorchscript,
    Controllers,
    Criteria,
    Drive,
    Keep,
    NoCriteria,
    Planner,
    UserValues,
)
from eidrive_scenario.cli.error_output import print_warnings
from eidrive_scenario.cli.live import Live, LivePort, LiveSpeed, live_view, wait_until_closed
from eidrive_scenario.cli.option_values import check_seconds, parse_assignments, parse_senders
from eidrive_scenario.cli.output_paths import check_output_paths
from eidrive_scenario.cli.run_failures import RunFailures
from eidrive_scenario.cli.short_help import HelpAll, rare
from eidrive_scenario.cli.streams import echo, has_all_characters
from eidrive_scenario.cli.supervision import supervise
from eidrive_scenario.errors import ConstraintError, Diagnostic, EidriveError, InputError, SettingError
from eidrive_scenario.exit_codes import ABORTED, INVALID_INPUT

if TYPE_CHECKING:
    from eidrive_scenario.openscenario import ConcreteRun
    from eidrive_scenario.recording import Explanation

CONFIDENCE = 0.95
"""Default confidence of `--success-rate`."""


def run(
    ctx: typer.Context,
    scenario: Annotated[
        str,
        typer.Argument(
            help="An .xosc file, or a library name; all runs of a distribution.",
        ),
    ],
    channel: Annotated[
        str | None,
        typer.Option(
            help="Channel profile: name, file or YAML; none: no cooperation.",
            show_default=False,
        ),
    ] = None,
    detector: Annotated[str | None, typer.Option(help="Detector of all stations.", show_default=False)] = None,
    planner: Planner = None,
    weather: Annotated[str | None, typer.Option(help="Weather preset: name or file.", show_default=False)] = None,
    cooperate: Annotated[
        str | None,
        typer.Option(metavar="A,B|none", help="Senders whose messages are used.", show_default=False),
    ] = None,
    param: Annotated[
        list[str] | None, typer.Option(metavar="K=V", help="Parameter of the scenario; repeatable.")
    ] = None,
    user_value: UserValues = None,
    controller: Controllers = None,
    drive: Drive = None,
    criterion: Criteria = None,
    no_criteria: NoCriteria = False,
    seed: Annotated[int, typer.Option(help="Seed of all random numbers.")] = 1,
    repeat: Annotated[int, typer.Option(min=1, metavar="N", help="Number of runs; seeds from --seed on.")] = 1,
    success_rate: Annotated[
        float | None,
        typer.Option(
            metavar="RATE",
            help="Run seeds until it is shown whether the success rate is RATE; at most --repeat, or 500.",
        ),
    ] = None,
    confidence: Annotated[
        float | None, rare(help="Confidence of --success-rate.", show_default=f"{CONFIDENCE:g}")
    ] = None,
    max_runs: Annotated[
        int | None,
        rare(
            min=1,
            help="Maximum runs of a distribution, spread over its values.",
            show_default="all",
        ),
    ] = None,
    dt: Annotated[float, rare(help="Time step in seconds.")] = 0.05,
    wall_limit: Annotated[
        float | None,
        rare(
            metavar="SECONDS",
            help="Maximum wall time of each run with loading.",
            show_default="none",
        ),
    ] = None,
    time_limit: Annotated[float, rare(help="Maximum simulated time in seconds.")] = 120.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of a subfolder per run: recording, result.json."),
    ] = None,
    no_record: Annotated[bool, rare("--no-record", help="Omit recording.mcap and camera images.")] = False,
    record: Annotated[
        Keep | None, rare(help="Runs whose recording and images --out keeps.", show_default="always")
    ] = None,
    topics: Annotated[
        str | None,
        rare(metavar="A,B", help="Tools whose topics the recording gets, too: foxglove, osi."),
    ] = None,
    csv: Annotated[Path | None, rare(help="File for one row per actor and tick.")] = None,
    log: Annotated[
        str | None,
        rare(metavar="FILE|-", help="File for storyboard transitions and reasons; -: stdout."),
    ] = None,
    explain: Annotated[
        list[str] | None,
        rare(
            metavar="EVENT",
            help="Explain the start of an event or act, or its absence; repeatable.",
        ),
    ] = None,
    live: Live = False,
    live_speed: LiveSpeed = None,
    live_port: LivePort = None,
    allow_torchscript: AllowTorchscript = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object per run only.")] = False,
    help_all: HelpAll = False,
) -> None:
    """Run and evaluate a scenario, or all runs of a parameter value distribution.

    Example: eidrive run coop/scenario_1 --channel latency_300ms --repeat 10 --out reports

    Without an option, the scenario file decides.
    """
    from eidrive_scenario.experiments.commands import reproduction_lines
    from eidrive_scenario.experiments.single_run import as_json_text, run_and_save
    from eidrive_scenario.library import definition, resolve_scenario
    from eidrive_scenario.recording.text.run_log import STANDARD_OUTPUT
    from eidrive_scenario.simulation import RunSettings
    from eidrive_scenario.simulation.added_settings import parse_drive

    if json and log == STANDARD_OUTPUT:
        raise SettingError(Diagnostic("--log - and --json both write to standard output", "give a file to --log"))

    if no_record and record not in (None, Keep.never):
        message = f"--no-record and --record {record} contradict each other"
        raise SettingError(Diagnostic(message, "remove one of them"))
    if record is not None and out is None:
        raise SettingError(Diagnostic("--record without --out has no effect", "add --out DIR"))
    kept = Keep.never.value if no_record else (record or Keep.always).value
    wanted: tuple[str, ...] = ()
    if topics is not None:
        from eidrive_scenario.export.tool_topics import add_topics, check_topics

        wanted = check_topics(name.strip() for name in topics.split(","))
        if out is None or kept == Keep.never.value:
            raise SettingError(Diagnostic("--topics is given, but no run is recorded", "give --out DIR, too"))
    failures = RunFailures(scenario, json=json, traceback=bool(ctx.find_root().params.get("traceback")))
    for option, seconds in (("--dt", dt), ("--time-limit", time_limit), ("--wall-limit", wall_limit)):
        if seconds is not None:
            check_seconds(option, seconds)
    if wall_limit is not None:
        report = partial(failures.report_dump, wall_limit)
        supervise(failures.end_hung_run, report, publish=failures.share)
    parameters = parse_assignments("--param", param or [])
    stacks = parse_drive("--drive", drive or [])
    settings = RunSettings(
        channel=channel,
        detector=detector,
        planner=planner,
        cooperate=parse_senders(cooperate),
        weather=weather,
        parameters=parameters,
        user_values=parse_assignments("--user-value", user_value or []),
        controllers=parse_assignments("--controller", controller or []),
        drive=stacks,
        criteria=criterion,
        dt=dt,
        time_limit=time_limit,
        allow_torchscript=allow_torchscript,
        no_criteria=no_criteria,
    )

    if success_rate is not None:
        from eidrive_scenario.cli.rate import decision_code, rate_test

        test = rate_test(success_rate, CONFIDENCE if confidence is None else confidence, repeat)
    elif confidence is not None:
        raise SettingError(Diagnostic("--confidence without --success-rate has no effect", "add --success-rate RATE"))
    else:
        test = None
    most = repeat if test is None else test.limit

    path = resolve_scenario(scenario)
    is_distribution = definition(path) == "distribution"
    written = {"--csv": csv, "--log": None if log == STANDARD_OUTPUT else log}
    check_output_paths(written, (path, channel, weather, *stacks.values(), *(criterion or ())))
    several = "--success-rate" if test is not None else f"--repeat {repeat}" if repeat > 1 else ""
    if is_distribution and max_runs != 1:
        several = several or "a distribution; --max-runs 1 runs one of it"
    viewed = ctx.with_resource(live_view(live, live_speed, live_port, several=several, to_stderr=json))
    watching = () if viewed is None else (viewed,)

    def run_seeds(source: Path | ConcreteRun) -> list[int]:
        codes: list[int] = []
        parts = [] if isinstance(source, Path) else [f"run-{source.number}"]
        for each in range(seed, seed + most):
            if test is not None and (decided := decision_code(test, codes, json=json)) is not None:
                return [decided]
            suffixes = [*parts, f"seed-{each}"] if most > 1 else parts
            explanations = _explanations(explain) if explain else []
            failures.begin(each, None if isinstance(source, Path) else source.number)
            try:
                result = run_and_save(
                    source,
                    seed=each,
                    settings=settings,
                    below=out,
                    record=kept,
                    csv=_with_suffixes(csv, suffixes) if csv is not None else None,
                    log=_with_suffixes(Path(log), suffixes) if log is not None and log != STANDARD_OUTPUT else log,
                    explanations=explanations,
                    observers=watching,
                    wall_limit=wall_limit,
                )
                if result.recording is not None and wanted:
                    added = add_topics(result.recording, wanted)
                    result = replace(result, warnings=(*result.warnings, *added))
            except InputError as error:
                if not codes or isinstance(error, ConstraintError):
                    raise
                echo(f"seed {each}: {error}", err=True)  # The values that it draws are invalid
                codes.append(INVALID_INPUT)
                continue
            except EidriveError as error:
                failures.report(error)
                wait_until_closed(viewed)
                codes.append(ABORTED)
                continue
            if json:
                echo(as_json_text(result, ascii_only=not has_all_characters()))
                print_warnings(result.warnings)
                for line in reproduction_lines(result):
                    echo(line, err=True)
            else:
                from eidrive_scenario.cli.verdicts import show

                show(result, varied="" if isinstance(source, Path) else str(source))
            if result.folder is not None:
                echo(f"files: {result.folder}", err=json)
            for explanation in explanations:
                echo("\n".join(explanation.lines()), err=json)
            wait_until_closed(viewed)
            codes.append(result.exit_code)
        decided = None if test is None else decision_code(test, codes, json=json)
        return codes if decided is None else [decided]

    if is_distribution:
        from eidrive_scenario.cli.batch import run_distribution

        raise typer.Exit(
            run_distribution(
                path,
                run_seeds,
                seed=seed,
                repeat=repeat if test is None else 1,
                max_runs=max_runs,
                parameters=parameters,
            )
        )
    if max_runs is not None:
        raise SettingError(
            Diagnostic(f"--max-runs has no effect for a scenario (got {max_runs})", "remove the option", str(path))
        )
    raise typer.Exit(max(run_seeds(path)))


def _explanations(names: list[str]) -> list[Explanation]:
    from eidrive_scenario.recording import Explanation

    return [Explanation(name) for name in names]


def _with_suffixes(path: Path, suffixes: list[str]) -> Path:
    """Return the file of one run among several. All runs write to one device; `atomic_output` refuses a folder."""
    if not suffixes or (path.exists() and not path.is_file()):
        return path
    return path.with_stem("-".join([path.stem, *suffixes]))
