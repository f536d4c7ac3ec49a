"""One run as a test: execution and report properties."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import Diagnostic, InputError, SettingError, suggestion
from eidrive_scenario.pytest_plugin.failures import WARNING, add_properties, record_of
from eidrive_scenario.pytest_plugin.option_values import path_beside, split_channels
from eidrive_scenario.pytest_plugin.options import (
    OPTIONS,
    command_line_value,
    listed_value,
    option_value,
    runs_folder,
    wall_limit,
)
from eidrive_scenario.pytest_plugin.variants import MarkerSettings, RunVariant
from eidrive_scenario.run_options import (
    Criteria,
    Stacks,
    diagnostic_with_option_names,
    option_of,
    with_option_names,
)

if TYPE_CHECKING:
    from eidrive_scenario.experiments.success_rate import RateVerdict
    from eidrive_scenario.openscenario import ConcreteRun, Source
    from eidrive_scenario.simulation import RunResult
    from eidrive_scenario.simulation.resolved_settings import ResolvedSettings

Properties = list[tuple[str, object]]

_NOT_REPEATED = ("out", "record", "topics", "report")
"""Options that the command of a test omits, as they neither change nor select its run."""


def run_and_report(
    item: pytest.Item,
    source: Source | ConcreteRun,
    variant: RunVariant,
    overrides: Mapping[str, Any] = MappingProxyType({}),
    *,
    file: Path | None = None,
) -> RunResult | RateVerdict:
    """Run a scenario with the options, the variant and `overrides` (fields of RunSettings), in ascending priority.

    file  path that the output folder follows; None: that of the scenario, or without a file that of the test

    A test of the success rate runs one seed after the other until it decides. The properties of the outcome are added
    to the report of the test. Raise InputError.
    """
    if file is None:
        own = item.path.with_suffix("") / f"{item.name.replace('/', '-')}.xosc"
        file = source if isinstance(source, Path) else own
    if variant.rate is None:
        result = _run(item, file, source, variant, overrides)
        result = replace(result, warnings=(*result.warnings, *variant.replaced))
        add_properties(item, properties(result))
        return result
    from eidrive_scenario.experiments.success_rate import decide_rate

    warnings: dict[str, None] = {}

    def run(seed: int) -> RunResult:
        result = _run(item, file, source, replace(variant, seed=seed), overrides)
        warnings.update(dict.fromkeys(result.warnings))
        return result

    verdict = decide_rate(run, variant.rate)
    add_properties(item, rate_properties(verdict))
    add_properties(item, ((WARNING, warning) for warning in (*warnings, *variant.replaced)))
    return verdict


def _command(item: pytest.Item, source: Source | ConcreteRun) -> str:
    """Return the command line of pytest for a run that `eidrive run` cannot repeat, else "".

    This is a run of a scenario without a file, or with extensions that only code of the tests registers.
    """
    from eidrive_scenario.experiments.commands import command_of_source
    from eidrive_scenario.extensions.registry import has_unnamed_registrations
    from eidrive_scenario.simulation import RunSettings

    is_repeatable = command_of_source(source, 1, RunSettings()) and not has_unnamed_registrations()
    return "" if is_repeatable else pytest_command(item)


def pytest_command(item: pytest.Item) -> str:
    """Return the command line that repeats a test, including all runs of it."""
    words = ["pytest", "::".join([str(item.path), *item.nodeid.split("::")[1:]])]
    for option in OPTIONS:
        value = None if option.name in _NOT_REPEATED else command_line_value(item.config, option.name)
        for given in value if option.repeatable and value else [] if value is None else [value]:
            words += [option.flag, _option_text(option.name, given)]
    return shlex.join(words)


def _option_text(name: str, value: Any) -> str:
    """Return the text of an option that is valid in any folder."""
    if name == "channel":
        return ",".join(_absolute(channel) for channel in split_channels(value))
    if name == "drive":
        entity, equals, stack = value.partition("=")
        return f"{entity}{equals}{_absolute(stack) if equals else ''}"
    return f"{value.bad:g}" if hasattr(value, "bad") else _absolute(str(value)) if name == "criterion" else str(value)


def _absolute(value: str) -> str:
    return str(path_beside(value, Path.cwd()))


def _run(
    item: pytest.Item,
    file: Path,
    source: Source | ConcreteRun,
    variant: RunVariant,
    overrides: Mapping[str, Any],
) -> RunResult:
    # Imported at the first run: pytest loads this plugin in every project of its environment.
    from eidrive_scenario.experiments.single_run import run_and_save
    from eidrive_scenario.simulation import RunSettings
    from eidrive_scenario.simulation.run_outcome import UNJUDGED

    config, overrides = item.config, dict(overrides)
    limit = overrides.pop("wall_limit", wall_limit(config))
    names = [field.name for field in fields(RunSettings)]
    for keyword in overrides:
        if keyword not in names:
            raise SettingError(Diagnostic(f"run_scenario: unknown setting {keyword!r}", suggestion(keyword, names)))
    option_names = _option_names(config, variant, overrides)
    if "criteria" in overrides:
        variant = replace(variant, added=replace(variant.added, criteria=overrides.pop("criteria")))
    settings: dict[str, Any] = {}
    for option in OPTIONS:
        if (value := option_value(config, option.name)) is not None and option.setting:
            settings[option.setting] = option_of(option.setting).form.parse(option_names[option.setting], value)
    settings |= {
        "channel": _channel(config, variant.channel),
        "no_criteria": option_value(config, "without_criteria") in ("warn", "pass"),
        **added_settings(config, variant.added),
    }
    settings.update(overrides)
    below = runs_folder(config)
    below = below and below.joinpath(*_subfolders(config, file))
    try:
        result = run_and_save(
            source,
            seed=variant.seed,
            settings=RunSettings(**settings),
            below=below,
            record=option_value(config, "record") or True,
            wall_limit=limit,
            command=_command(item, source),
        )
    except InputError as error:
        renamed = [diagnostic_with_option_names(diagnostic, option_names) for diagnostic in error.diagnostics]
        raise type(error)(renamed) from None
    result = replace(result, warnings=tuple(with_option_names(text, option_names) for text in result.warnings))
    if option_value(config, "without_criteria") == "pass":
        result = replace(result, warnings=tuple(text for text in result.warnings if text != UNJUDGED))
    if result.folder is not None:
        record_of(item).folders.append(str(result.folder))
    if result.recording is not None and (topics := option_value(config, "topics")):
        from eidrive_scenario.export.tool_topics import add_topics

        result = replace(result, warnings=(*result.warnings, *add_topics(result.recording, topics)))
    return result


def _option_names(config: pytest.Config, variant: RunVariant, keywords: Collection[str]) -> dict[str, str]:
    """Return what gives each setting of a run, for messages: an option, an ini option, or a keyword of the test.

    A setting that nothing gives has the name of its option.
    """
    channel = None if variant.channel in split_channels(",".join(listed_value(config, "channel"))) else variant.channel
    of_marker = {"channel": channel, **vars(variant.added)}
    names = {"no_criteria": "--eidrive-without-criteria pass"}
    for option in OPTIONS:
        if not option.setting:
            continue
        names[option.setting] = option.flag
        if command_line_value(config, option.name) is None:
            if of_marker.get(option.setting) is not None:
                names[option.setting] = option.setting
            elif option_value(config, option.name) is not None:
                names[option.setting] = f"ini option {option.key}"
    return {**names, **{name: name for name in keywords}}


def added_settings(config: pytest.Config, marker: MarkerSettings) -> dict[str, Any]:
    """Return `drive` and `criteria` of a run: of the ini file, the marker and the command line.

    A stack of the command line replaces that of the marker for the same entity, and this one that of the ini file.
    Criteria are added; those of a keyword are in the place of those of the marker. Raise SettingError for an invalid
    value.
    """
    root, stacks = config.rootpath, Stacks()
    listed = stacks.parse("eidrive_drive", listed_value(config, "drive"))
    in_file = {name: stack and path_beside(stack, root) for name, stack in listed.items()}
    by_option = stacks.parse("--eidrive-drive", command_line_value(config, "drive") or ())
    criteria = [path_beside(criterion, root) for criterion in listed_value(config, "criterion")]
    return {
        "drive": {**in_file, **stacks.check("drive", marker.drive), **by_option},
        "criteria": [
            *criteria,
            *Criteria().check("criteria", marker.criteria),
            *(command_line_value(config, "criterion") or ()),
        ],
    }


def _channel(config: pytest.Config, channel: str | None) -> Any:
    """Return a channel; a file of the ini option is relative to the root."""
    is_listed = channel in split_channels(",".join(listed_value(config, "channel")))
    return path_beside(channel, config.rootpath) if is_listed else channel


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
    from eidrive_scenario.base.content_digest import canonical_json

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
