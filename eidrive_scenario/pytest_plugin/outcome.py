"""One run as a test: execution, report properties, and text of a failure."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import Diagnostic, EidriveError, ExtensionError, InputError, SettingError, suggestion
from eidrive_scenario.pytest_plugin.hung_runs import wall_limit_of
from eidrive_scenario.pytest_plugin.options import MarkerSettings, RunVariant
from eidrive_scenario.resolved_settings import ResolvedSettings, canonical_json

if TYPE_CHECKING:
    from eidrive_scenario.evaluation import Verdict
    from eidrive_scenario.experiments.success_rate import RateVerdict
    from eidrive_scenario.openscenario import ConcreteRun, Source
    from eidrive_scenario.simulation import RunResult

Properties = list[tuple[str, object]]

_SHOWN_FAILURES = 5
"""Number of failed runs that a failed test of the success rate explains."""
WARNING = "warning"
"""Name of the properties with the warnings of a run."""


class ScenarioFailed(Exception):
    """Failed verdict of a run."""

    def __init__(self, result: RunResult | RateVerdict) -> None:
        super().__init__(explain_outcome(result))
        self.result = result


def run_file_and_report(
    item: pytest.Item, source: Path, variant: RunVariant, run: ConcreteRun | None = None
) -> RunResult | RateVerdict:
    """Run the scenario of a test, or one run of its distribution, and record its properties. Raise InputError.

    A test of the success rate runs one seed after the other until it decides.
    """
    result: RunResult | RateVerdict
    if variant.rate is None:
        result = _run_and_report(item.config, source, run or source, variant, {})
        item.user_properties.extend(properties(result))
    else:
        from eidrive_scenario.experiments.success_rate import decide_rate

        result = decide_rate(
            lambda seed: _run_and_report(item.config, source, run or source, replace(variant, seed=seed), {}),
            variant.rate,
        )
        item.user_properties.extend(rate_properties(result))
    if run is not None:
        item.user_properties.extend((f"parameter.{name}", value) for name, value in run.parameters.items())
    return result


def run_variant(item: pytest.Item, source: Source, variant: RunVariant, **overrides: Any) -> RunResult:
    """Run a scenario with the options, the variant and `overrides` (fields of RunSettings), in ascending priority.

    The output folder follows the path of the scenario, or without a file the path of the test. Raise InputError.
    """
    file = source if isinstance(source, Path) else item.path.with_suffix("") / f"{item.name.replace('/', '-')}.xosc"
    return _run_and_report(item.config, file, source, variant, overrides, command=pytest_command(item))


def pytest_command(item: pytest.Item) -> str:
    """Return the command line that repeats a test, including runs of scenarios without a file."""
    words = ["pytest", "::".join([str(item.path), *item.nodeid.split("::")[1:]])]
    for name in ("channel", "detector", "planner", "seeds"):
        value = item.config.getoption(f"eidrive_{name}")
        if value is not None:
            words += [f"--eidrive-{name}", ",".join(value) if isinstance(value, list) else str(value)]
    for name in ("drive", "criterion"):
        for value in item.config.getoption(f"eidrive_{name}") or ():
            words += [f"--eidrive-{name}", value]
    return shlex.join(words)


def _run_and_report(
    config: pytest.Config,
    file: Path,
    source: Source | ConcreteRun,
    variant: RunVariant,
    overrides: Mapping[str, Any],
    command: str = "",
) -> RunResult:
    # Imported at the first run: pytest loads this plugin in every project of its environment.
    from eidrive_scenario.experiments.single_run import run_and_save
    from eidrive_scenario.simulation import RunSettings

    overrides = dict(overrides)
    wall_limit = overrides.pop("wall_limit", wall_limit_of(config))
    known = [field.name for field in fields(RunSettings)]
    for keyword in overrides:
        if keyword not in known:
            raise SettingError(Diagnostic(f"run_scenario: unknown setting {keyword!r}", suggestion(keyword, known)))
    settings: dict[str, Any] = {
        "channel": variant.channel,
        "detector": config.getoption("eidrive_detector"),
        "planner": config.getoption("eidrive_planner"),
        **added_settings(config, variant.added),
        **overrides,
    }
    folder = config.getoption("eidrive_out")
    below = Path(config.invocation_params.dir, folder, *_subfolders(config, file)) if folder is not None else None
    return run_and_save(
        source,
        seed=variant.seed,
        settings=RunSettings(**settings),
        below=below,
        wall_limit=wall_limit,
        command=command,
    )


def added_settings(config: pytest.Config, marker: MarkerSettings) -> dict[str, Any]:
    """Return `drive` and `criteria` of a run: of the ini file, the marker and the command line.

    A stack of the command line replaces that of the marker for the same entity, and this one that of the ini file.
    Criteria are added. Raise SettingError for an invalid value.
    """
    from eidrive_scenario.simulation.added_settings import criteria_sources, drive_sources, parse_drive

    root = config.rootpath
    listed = parse_drive("eidrive_drive", config.getini("eidrive_drive"))
    in_file = {name: stack and path_beside(stack, root) for name, stack in listed.items()}
    by_option = parse_drive("--eidrive-drive", config.getoption("eidrive_drive") or ())
    criteria = [path_beside(one, root) for one in config.getini("eidrive_criteria")]
    return {
        "drive": {**in_file, **drive_sources(marker.drive), **by_option},
        "criteria": [*criteria, *criteria_sources(marker.criteria), *(config.getoption("eidrive_criterion") or ())],
    }


def path_beside(source: Any, folder: Path) -> Any:
    """Return the path of a file relative to a folder, or any other value unchanged."""
    if isinstance(source, str | Path) and os.path.isfile(folder / source):
        return folder / source
    return source


def _subfolders(config: pytest.Config, source: Path) -> tuple[str, ...]:
    path = source.resolve().with_suffix("")
    return path.relative_to(config.rootpath).parts if path.is_relative_to(config.rootpath) else path.parts[-2:]


def properties(result: RunResult) -> Properties:
    """Return the report properties of a run: values and limits of the criteria, metrics, settings and trace hash.

    Values are plain numbers and texts, because pytest-xdist sends no other types to its controller.
    """
    entries: Properties = [("channel", result.channel), ("seed", result.seed), ("end_reason", result.end_reason)]
    if result.run is not None:
        entries.append(("run", result.run))
    for verdict in result.criteria:
        entries.append((f"{verdict.name}.passed", bool(verdict.passed)))
        if verdict.value is not None:
            entries.append((f"{verdict.name}.value", float(verdict.value)))
        if verdict.limit is not None:
            entries.append((f"{verdict.name}.limit", float(verdict.limit)))
    entries += ((name, float(value)) for name, value in result.metrics.items())
    entries += ((WARNING, warning) for warning in result.warnings)
    entries += setting_properties(result.settings)
    return [*entries, ("simulated_s", result.simulated_s), ("trace_hash", result.trace_hash)]


def setting_properties(settings: ResolvedSettings) -> Properties:
    """Return one property for each resolved setting, as text, number or JSON, and the hash of all settings."""
    entries: Properties = []
    for name, value in settings.as_json().items():
        plain = isinstance(value, str | int | float) and not isinstance(value, bool)
        entries.append((f"settings.{name}", value if plain else canonical_json(value)))
    return [*entries, ("settings_sha256", settings.digest)]


def rate_properties(verdict: RateVerdict) -> Properties:
    """Return the report properties of a test of the success rate."""
    rate = verdict.rate
    return [
        ("success_rate.decision", str(verdict.decision)),
        ("success_rate.at_least", verdict.test.bad),
        ("success_rate.confidence", 1.0 - verdict.test.false_pass),
        ("success_rate.passed_runs", rate.successes),
        ("success_rate.runs", rate.trials),
        ("success_rate.low", rate.low),
        ("success_rate.high", rate.high),
        ("success_rate.failed_seeds", ",".join(str(failure.seed) for failure in verdict.failures)),
    ]


def explain_rate(verdict: RateVerdict) -> str:
    """Return the reason of a failed or undecided test of the success rate, with its first failed runs."""
    shown = [explain(failure) for failure in verdict.failures[:_SHOWN_FAILURES]]
    more = len(verdict.failures) - len(shown)
    return "\n\n".join([str(verdict), *shown, *([f"and {more} more failed runs"] if more else [])])


def explain_outcome(result: RunResult | RateVerdict) -> str:
    """Return the reason of a failed run, or of a failed test of the success rate."""
    from eidrive_scenario.simulation import RunResult

    return explain(result) if isinstance(result, RunResult) else explain_rate(result)


def explain(result: RunResult) -> str:
    """Return the reasons of a failed run, the command that repeats it, and the path of its recording."""
    from eidrive_scenario.experiments.commands import reproduction_lines

    lines = [f"{verdict.name}: {verdict.reason}{_limit(verdict)}" for verdict in result.criteria if not verdict.passed]
    if not lines:
        lines = [f"ended by its {result.end_reason} after {result.simulated_s:.2f} s"]
    run = "" if result.run is None else f"run {result.run} of "
    head = f"{run}{result.scenario} failed with channel {result.channel}, seed {result.seed}"
    return "\n".join([head, *lines, *reproduction_lines(result)])


def _limit(verdict: Verdict) -> str:
    return f" (limit {verdict.limit:g} {verdict.unit})" if verdict.limit is not None and verdict.unit else ""


def failure_text(error: BaseException) -> str | None:
    """Return the text of a failure without traceback, or None for an error that requires a traceback."""
    if isinstance(error, ScenarioFailed | InputError):
        return str(error)
    notes: list[str] = getattr(error, "__notes__", [])
    if isinstance(error, OSError) and notes:
        return "\n".join([f"aborted: {error}", *notes])
    if not isinstance(error, EidriveError):
        return None
    lines = [str(error), *notes]
    if isinstance(error, ExtensionError):
        from eidrive_scenario.simulation.attribution import traceback_from_extension

        lines += ["", traceback_from_extension(error)]
    return "\n".join(lines).rstrip()
