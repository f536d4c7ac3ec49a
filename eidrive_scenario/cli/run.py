"""Command `eidrive run`."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.options import (
    STANDARD_OUTPUT,
    HelpAll,
    Record,
    check_output_paths,
    check_record,
    rare,
    takes_run_options,
)
from eidrive_scenario.cli.output import echo, has_all_characters, print_warnings
from eidrive_scenario.cli.supervision import RunFailures, supervise
from eidrive_scenario.errors import (
    ABORTED,
    INVALID_INPUT,
    ConstraintError,
    Diagnostic,
    EidriveError,
    InputError,
    SettingError,
    in_one_line,
)
from eidrive_scenario.recording.run_files import RecordMode
from eidrive_scenario.run_options import RunSettings, check_seconds

if TYPE_CHECKING:
    from eidrive_scenario.experiments.statistics.sequential import RatioTest
    from eidrive_scenario.openscenario import ConcreteRun
    from eidrive_scenario.reporting.live.live_view import LiveView
    from eidrive_scenario.simulation import RunResult

CONFIDENCE = 0.95
"""Default confidence of `--success-rate`."""

Live = Annotated[bool, typer.Option("--live", help="Show the run in the browser while it is in progress.")]
LiveSpeed = Annotated[
    str | None,
    rare(metavar="FACTOR|max", help="Simulated seconds per second with --live.", show_default="1"),
]
LivePort = Annotated[
    int | None, rare(min=1, max=65535, metavar="PORT", help="Port of --live.", show_default="a free one")
]


@takes_run_options("run", at="seed", before={"dt": "wall_limit", "time_limit": "out", "allow_torchscript": "json"})
def run(
    settings: RunSettings,
    ctx: typer.Context,
    scenario: Annotated[
        str,
        typer.Argument(
            help="An .xosc file, or a library name; all runs of a distribution.",
        ),
    ],
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
    wall_limit: Annotated[
        float | None,
        rare(
            metavar="SECONDS",
            help="Maximum wall time of each run with loading.",
            show_default="none",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of a subfolder per run: recording, result.json."),
    ] = None,
    no_record: Annotated[bool, rare("--no-record", help="Omit recording.mcap and camera images.")] = False,
    record: Record = None,
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
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object per run only.")] = False,
    help_all: HelpAll = False,
) -> None:
    """Run and evaluate a scenario, or all runs of a parameter value distribution.

    Example: eidrive run coop/scenario_1 --channel latency_300ms --repeat 10 --out reports

    Without an option, the scenario file decides.
    """
    from eidrive_scenario.extensions.library import definition, resolve_scenario

    if json and log == STANDARD_OUTPUT:
        raise SettingError(Diagnostic("--log - and --json both write to standard output", "give a file to --log"))
    if no_record and record not in (None, RecordMode.NEVER):
        message = f"--no-record and --record {record} contradict each other"
        raise SettingError(Diagnostic(message, "remove one of them"))
    check_record(record, out)
    kept = RecordMode.NEVER if no_record else record or RecordMode.ALWAYS
    tools = _tools(topics, is_recorded=out is not None and kept is not RecordMode.NEVER)
    failures = RunFailures(scenario, json=json, traceback=bool(ctx.find_root().params.get("traceback")))
    if wall_limit is not None:
        check_seconds("--wall-limit", wall_limit)
        supervise(wall_limit, failures.report_hang, failures.subject)
    test = _rate_test(success_rate, confidence, repeat)
    count = repeat if test is None else test.limit

    path = resolve_scenario(scenario)
    is_distribution = definition(path) == "distribution"
    outputs = {"--csv": csv, "--log": None if log == STANDARD_OUTPUT else log, "--out": out}
    check_output_paths(outputs, (path, *settings.sources))
    several = "--success-rate" if test is not None else f"--repeat {repeat}" if repeat > 1 else ""
    if is_distribution and max_runs != 1:
        several = several or "a distribution; --max-runs 1 runs one of it"
    view = ctx.with_resource(live_view(live, live_speed, live_port, several=several, to_stderr=json))
    runs = _Runs(
        settings,
        range(seed, seed + count),
        test,
        failures,
        view,
        out,
        kept,
        tools,
        csv,
        log,
        explain or [],
        wall_limit,
        json,
    )
    if is_distribution:
        from eidrive_scenario.cli.repeated_runs import run_distribution

        raise typer.Exit(
            run_distribution(
                path,
                runs.execute,
                seed=seed,
                repeat=repeat if test is None else 1,
                max_runs=max_runs,
                parameters=settings.parameters,
            )
        )
    if max_runs is not None:
        raise SettingError(
            Diagnostic(f"--max-runs has no effect for a scenario (got {max_runs})", "remove the option", str(path))
        )
    raise typer.Exit(max(runs.execute(path)))


def _tools(topics: str | None, *, is_recorded: bool) -> tuple[str, ...]:
    """Return the tools of `--topics`. Raise SettingError for an unknown one, and without a recording."""
    if topics is None:
        return ()
    from eidrive_scenario.export.tool_topics import check_topics

    tools = check_topics(name.strip() for name in topics.split(","))
    if not is_recorded:
        raise SettingError(Diagnostic("--topics is given, but no run is recorded", "give --out DIR, too"))
    return tools


def _rate_test(success_rate: float | None, confidence: float | None, repeat: int) -> RatioTest | None:
    """Return the test of `--success-rate`, or None. Raise SettingError for options that do not fit together."""
    if success_rate is not None:
        from eidrive_scenario.cli.repeated_runs import rate_test

        return rate_test(success_rate, CONFIDENCE if confidence is None else confidence, repeat)
    if confidence is not None:
        raise SettingError(Diagnostic("--confidence without --success-rate has no effect", "add --success-rate RATE"))
    return None


@dataclass(frozen=True)
class _Runs:
    """Runs of one command: settings, seeds, and what is written about each run.

    test   test of the success rate, which ends the runs; None for one run with each seed
    kept   runs whose recording is kept
    tools  tools whose topics the recordings get
    """

    settings: RunSettings
    seeds: Sequence[int]
    test: RatioTest | None
    failures: RunFailures
    view: LiveView | None
    out: Path | None
    kept: RecordMode
    tools: tuple[str, ...]
    csv: Path | None
    log: str | None
    explain: Sequence[str]
    wall_limit: float | None
    json: bool

    def execute(self, source: Path | ConcreteRun) -> list[int]:
        """Run a scenario, or one run of a distribution, with each seed, and return the exit codes."""
        codes: list[int] = []
        for seed in self.seeds:
            if (decided := self._decided(codes)) is not None:
                return [decided]
            self.failures.begin(seed, None if isinstance(source, Path) else source.number)
            try:
                codes.append(self._execute(source, seed))
            except InputError as error:
                if not codes or isinstance(error, ConstraintError):
                    raise
                echo(f"seed {seed}: {error}", err=True)  # The values that it draws are invalid
                codes.append(INVALID_INPUT)
            except EidriveError as error:
                self.failures.report(error)
                wait_until_closed(self.view)
                codes.append(ABORTED)
        decided = self._decided(codes)
        return codes if decided is None else [decided]

    def _decided(self, codes: list[int]) -> int | None:
        """Return the exit code of the test of the success rate after these runs, or None."""
        if self.test is None:
            return None
        from eidrive_scenario.cli.repeated_runs import decision_code

        return decision_code(self.test, codes, json=self.json)

    def _execute(self, source: Path | ConcreteRun, seed: int) -> int:
        """Execute and print one run, and return its exit code."""
        from eidrive_scenario.experiments.single_run import run_and_save
        from eidrive_scenario.recording.text.explanation import Explanation

        parts = [] if isinstance(source, Path) else [f"run-{source.number}"]
        suffixes = [*parts, f"seed-{seed}"] if len(self.seeds) > 1 else parts
        log = self.log
        explanations = [Explanation(name) for name in self.explain]
        result = run_and_save(
            source,
            seed=seed,
            settings=self.settings,
            below=self.out,
            record=self.kept,
            csv=None if self.csv is None else _with_suffixes(self.csv, suffixes),
            log=log if log in (None, STANDARD_OUTPUT) else _with_suffixes(Path(log), suffixes),
            explanations=explanations,
            observers=() if self.view is None else (self.view,),
            wall_limit=self.wall_limit,
        )
        if result.recording is not None and self.tools:
            from eidrive_scenario.export.tool_topics import add_topics

            result = replace(result, warnings=(*result.warnings, *add_topics(result.recording, self.tools)))
        self._print(result, "" if isinstance(source, Path) else str(source))
        for explanation in explanations:
            echo("\n".join(explanation.lines()), err=self.json)
        wait_until_closed(self.view)
        return result.exit_code

    def _print(self, result: RunResult, varied: str) -> None:
        """Print a result; `varied` are the parameters of a run of a distribution."""
        if self.json:
            from eidrive_scenario.experiments.commands import reproduction_lines
            from eidrive_scenario.experiments.single_run import as_json_text

            echo(as_json_text(result, ascii_only=not has_all_characters()))
            print_warnings(result.warnings)
            for line in reproduction_lines(result):
                echo(line, err=True)
        else:
            from eidrive_scenario.cli.console import show

            show(result, varied=varied)
        if result.folder is not None:
            echo(f"files: {in_one_line(result.folder)}", err=self.json)


def _with_suffixes(path: Path, suffixes: list[str]) -> Path:
    """Return the file of one run among several. All runs write to one device; `atomic_output` refuses a folder."""
    if not suffixes or (os.path.exists(path) and not os.path.isfile(path)):
        return path
    return path.with_stem("-".join([path.stem, *suffixes]))


def live_view(
    requested: bool, speed: str | None, port: int | None, *, several: str, to_stderr: bool
) -> AbstractContextManager[LiveView | None]:
    """Return the live view of a run, or a context of None if it is not requested.

    several    option that requests several runs; empty for a single run
    to_stderr  whether the address is printed to standard error

    Raise SettingError for an invalid option, several runs, and a port that cannot be used.
    """
    for option, value in (("--live-speed", speed), ("--live-port", port)):
        if value is not None and not requested:
            raise SettingError(Diagnostic(f"{option} without --live has no effect", "add --live"))
    if not requested:
        return nullcontext()
    if several:
        hint = "run one seed with --live; record several with --out, and read them by eidrive report"
        raise SettingError(Diagnostic(f"--live shows a single run (got {several})", hint))
    factor = _speed(speed)
    from eidrive_scenario.reporting.live.live_view import WAIT, LiveView

    def announce(address: str) -> None:
        echo(f"live view: {address}", err=to_stderr)
        echo(f"The run starts when the page is open, at the latest in {WAIT:g} s.", err=True)

    return LiveView(speed=factor, port=port or 0, wait=WAIT, announce=announce)


def wait_until_closed(view: LiveView | None) -> None:
    """Wait after the end of a run until its pages are closed or the user interrupts."""
    if view is None:
        return
    with suppress(KeyboardInterrupt):
        if view.clients:
            echo("The run has ended. Close the page or press Ctrl-C.", err=True)
            view.wait_until_closed()


def _speed(text: str | None) -> float:
    if text is None:
        return 1.0
    if text == "max":
        return math.inf
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if factor == 0.0:
        return math.inf
    if not 0.0 < factor < math.inf:
        raise SettingError(Diagnostic(f"--live-speed is {text!r}", "give a factor such as 0.5, or max"))
    return factor
