"""Options of a run. Each is declared once, as a field of RunSettings.

The options of `eidrive run`, `check` and `sweep` and of pytest, the axes of sweeps, the resolved settings with their
JSON form, the tables and reports of runs, and the command that repeats a run are derived from these declarations. A new
option is one declaration, and the line of the engine that uses its value.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from eidrive_scenario.errors import Diagnostic, SettingError, quoted

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.values.parameters import Assignment

from eidrive_scenario.run_options.forms import (
    Assignments,
    Criteria,
    Form,
    Seconds,
    Senders,
    Stacks,
    Switch,
    Text,
    YamlSource,
)

DEFAULT_SEED = 1
"""Seed of a run for which none is given, in Python, in pytest and on the command line."""


@dataclass(frozen=True)
class PytestForm:
    """Option `--eidrive-NAME` and ini option `eidrive_NAME` of an option of a run; empty texts are derived from it.

    is_named  whether the names of tests contain its value
    """

    name: str = ""
    metavar: str = ""
    help: str = ""
    is_named: bool = False


@dataclass(frozen=True)
class RunOption:
    """Declaration of an option of a run.

    form      form of its values
    help      help of the command line
    name      name of the field of RunSettings, and key in JSON
    default   value of an omitted option
    flag      option of the command line; by default from the name
    metavar   placeholder of its value in the help
    rare      whether only `--help-all` describes it
    envvar    environment variable of its value on the command line
    commands  commands that have it, each with what differs there from `help` and `rare`
    pytest    its form in pytest; None if pytest does not have it
    detail    resolved setting that contains what the option changes; "" for the option itself
    in_result  whether it is one of the resolved settings of a result, as all options that determine the run
    in_row    whether a table of runs has a column of it
    unset     text of a report without a value; "" for none
    """

    form: Form
    help: str
    name: str = ""
    default: Any = None
    flag: str = ""
    metavar: str | None = None
    rare: bool = False
    envvar: str | None = None
    commands: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: _ALL)
    pytest: PytestForm | None = PytestForm()
    detail: str = ""
    in_result: bool = True
    in_row: bool = False
    unset: str = ""

    def words(self, value: Any) -> list[str]:
        """Return the words that give a value to `eidrive run`; empty for the value of an omitted option."""
        words: list[str] = []
        for text in [] if value == self.default else self.form.texts(value):
            if text.startswith("-"):  # the command line would read it as another option
                words.append(f"{self.flag}={text}")
            else:
                words += [self.flag, text] if text else [self.flag]
        return words


_OPTION = "option"
"""Key of the metadata of a field with its RunOption."""


def _option(form: Form, help: str, default: Any = None, **declared: Any) -> Any:
    """Return the field of an option of RunSettings. The further arguments are fields of RunOption."""
    default = form.omitted if default is None else default
    metadata = {_OPTION: RunOption(form, help, default=default, **declared)}
    if isinstance(default, dict):
        return field(default_factory=dict, metadata=metadata)
    return field(default=default, metadata=metadata)


def _with_batches(help: str) -> Mapping[str, Mapping[str, Any]]:
    """Return the commands of an option with this help in those of many runs."""
    return {"run": {}, "sweep": {"help": help}, "dataset": {"help": help}}


def _selection(noun: str, stations: str, commands: Mapping[str, Mapping[str, Any]]) -> Any:
    """Return the field of an option that selects an extension for these stations by its name."""
    text = f"{noun} of all {stations}"
    return _option(
        Text((str,), f"the name of a {noun}"),
        f"{text.capitalize()}.",
        commands=commands,
        detail="stations",
        in_row=True,
        pytest=PytestForm(metavar="NAME", help=f"{text} (default: the file's own)", is_named=True),
    )


_PLACE: tuple[type, ...] = (str, os.PathLike)
_RARE: Mapping[str, Any] = {"rare": True}
_RUN: Mapping[str, Mapping[str, Any]] = {"run": {}}
_RUN_AND_SWEEP: Mapping[str, Mapping[str, Any]] = {"run": {}, "sweep": {}}
_RUN_AND_DATASET: Mapping[str, Mapping[str, Any]] = {"run": {}, "dataset": _RARE}
_RUNNING: Mapping[str, Mapping[str, Any]] = {"run": {}, "sweep": {}, "dataset": {}}
_ALL: Mapping[str, Mapping[str, Any]] = {"run": {}, "check": {}, "sweep": {}, "dataset": {}}
"""Commands that have an option, each with what differs there."""


@dataclass(frozen=True)
class RunSettings:
    """Optional settings of a run; None uses the value of the scenario file.

    channel         profile: a name, a file, YAML text or a mapping; 'none' disables cooperation
    detector        for all stations
    fusion          fusion method of all stations
    planner         for all driven stations; parked ones, with the planner `none`, remain parked
    weather         preset or file; it overrides weather and road condition of the scenario
    cooperate       senders whose messages the receiving stations use; () disables reception
    parameters      values of scenario parameters; an Assignment contains the file and line of the value
    user_values     of UserDefinedValueConditions, by name; `Simulation.set_user_value` changes them during the run
    controllers     controller models of controllers of other tools, by the name of the controller; without an entry the
                    entity keeps lane and speed
    drive           entities that get a driving stack, which replaces their controllers: names, or a mapping of names to
                    the properties of the stack (mapping, YAML text, file; None: defaults); see docs/scenario_files.md
    criteria        further criteria: a mapping, a YAML text, a file, or a list of these
    dt              time step [s]
    time_limit      maximum simulated time [s], above 0, for scenarios without an end
    allow_torchscript  whether detectors may load TorchScript weights, which can execute any code; see docs/security.md
    no_criteria     whether a run that no criterion judges passes; without it, its exit code is NOT_JUDGED

    Texts of parameters, user-defined values and controllers are those of a command line, and sources of stacks and
    criteria are texts or files. Raise SettingError for values of a wrong type, and for a time limit that is not
    positive.
    """

    channel: str | os.PathLike[str] | Mapping[str, Any] | None = _option(
        Text((*_PLACE, Mapping), "the name, the file or the mapping of a channel profile", (".yaml", ".yml")),
        "Channel profile: name, file or YAML; none: no cooperation.",
        commands=_with_batches("Channel profile of all runs."),
        detail="channel_profile",
        pytest=PytestForm(
            metavar="A,B",
            help="run each scenario with each of these channel profiles (default: the file's own); none: no "
            "cooperation; repeatable",
        ),
    )
    detector: str | None = _selection("detector", "stations", _RUN_AND_DATASET)
    fusion: str | None = _selection("fusion method", "stations", _RUN_AND_DATASET)
    planner: str | None = _selection("planner", "driven stations", {"run": {}, "check": {}, "dataset": _RARE})
    weather: str | os.PathLike[str] | None = _option(
        Text(_PLACE, "the name or the file of a weather preset", None),
        "Weather preset: name or file.",
        commands={"run": {}, "dataset": {}},
        detail="weather_profile",
        in_row=True,
        unset="of the scenario",
        pytest=None,
    )
    cooperate: tuple[str, ...] | None = _option(
        Senders(),
        "Senders whose messages are used.",
        metavar="A,B|none",
        commands=_RUN_AND_DATASET,
        detail="stations",
        pytest=None,
    )
    parameters: Mapping[str, str | Assignment] = _option(
        Assignments("a mapping of names to values"),
        "Parameter of the scenario; repeatable.",
        flag="--param",
        commands=_with_batches("Parameter of all runs; repeatable."),
        pytest=None,
    )
    user_values: Mapping[str, str] = _option(
        Assignments("a mapping of names to values"),
        "Value for UserDefinedValueConditions; repeatable.",
        flag="--user-value",
        rare=True,
        commands=_RUNNING,
        pytest=None,
    )
    controllers: Mapping[str, str] = _option(
        Assignments("a mapping of controllers to controller models"),
        "Model V, such as alks, of controller K of another tool; repeatable.",
        flag="--controller",
        rare=True,
        commands=_RUNNING,
        pytest=None,
    )
    drive: Mapping[str, Any] | Iterable[str] | None = _option(
        Stacks(),
        "Give entity NAME a driving stack with the properties STACK (YAML or file).",
        metavar="NAME[=STACK]",
        commands={
            **_ALL,
            "sweep": {"help": "Give entity NAME a driving stack, as in `eidrive run`.", "rare": True},
            "dataset": {"help": "Give entity NAME a driving stack, as in `eidrive run`."},
        },
        pytest=PytestForm(
            help="give entity NAME a driving stack, with the properties in a YAML file or mapping STACK; repeatable"
        ),
    )
    criteria: (
        str | os.PathLike[str] | Mapping[str, Any] | Iterable[str | os.PathLike[str] | Mapping[str, Any]] | None
    ) = _option(
        Criteria(),
        "Further criteria: '{collision: {of: Ego}}'; repeatable.",
        flag="--criterion",
        metavar="YAML|FILE",
        commands={"run": {}, "check": {}, "sweep": {"help": "Add criteria; repeatable.", "rare": True}},
        pytest=PytestForm(
            "criterion",
            help="add criteria to those of each scenario, such as '{collision: {of: Ego}}', or those of a file; "
            "repeatable",
        ),
    )
    dt: float = _option(Seconds(), "Time step in seconds.", 0.05, rare=True, commands=_RUN, in_row=True, pytest=None)
    time_limit: float = _option(
        Seconds(is_positive=True),
        "Maximum simulated time in seconds.",
        120.0,
        rare=True,
        commands=_RUNNING,
        pytest=PytestForm(
            metavar="SECONDS", help="maximum simulated time of each run; an error if reached (default: 120)"
        ),
    )
    allow_torchscript: bool = _option(
        Switch(),
        "Load TorchScript weights, which can execute any code with your permissions.",
        rare=True,
        envvar="EIDRIVE_ALLOW_TORCHSCRIPT",
        in_result=False,
        pytest=None,
    )
    no_criteria: bool = _option(
        Switch(),
        "Accept runs that no criterion judges: they pass.",
        rare=True,
        commands=_RUN_AND_SWEEP,
        in_result=False,
        pytest=None,
    )

    def __post_init__(self) -> None:
        for option in OPTIONS:
            object.__setattr__(self, option.name, option.form.check(option.name, getattr(self, option.name)))

    @property
    def stacks(self) -> Mapping[str, YamlSource | None]:
        """Properties of the driving stacks of `drive` by entity: YAML texts or files; None for the defaults."""
        return cast("Mapping[str, YamlSource | None]", self.drive)

    @property
    def criteria_sources(self) -> tuple[YamlSource, ...]:
        """Declarations of `criteria`: YAML texts and files."""
        return cast("tuple[YamlSource, ...]", self.criteria)

    @property
    def sources(self) -> tuple[YamlSource, ...]:
        """Texts and paths that may name files which the run reads."""
        given = (self.channel, self.weather, *self.stacks.values(), *self.criteria_sources)
        return tuple(source for source in given if isinstance(source, str | Path))


OPTIONS: tuple[RunOption, ...] = tuple(
    replace(
        declared.metadata[_OPTION],
        name=declared.name,
        flag=declared.metadata[_OPTION].flag or f"--{declared.name.replace('_', '-')}",
    )
    for declared in fields(RunSettings)
)
"""All options of a run, in the order of RunSettings."""
FLAGS: Mapping[str, str] = {option.name: option.flag for option in OPTIONS}
"""Options of the command line by the name of the setting."""
_SETTING = re.compile(r"(?<!\w)RunSettings\.(\w+)")


def option_of(name: str) -> RunOption:
    """Return the option of a field of RunSettings."""
    return next(option for option in OPTIONS if option.name == name)


def options_of(command: str) -> list[RunOption]:
    """Return the options of a command of the command line, with the help that they have there."""
    return [replace(option, **option.commands[command]) for option in OPTIONS if command in option.commands]


def checked_settings(settings: RunSettings | None) -> RunSettings:
    """Return settings, the default ones for None. Raise SettingError for another object."""
    if settings is not None and not isinstance(settings, RunSettings):
        raise SettingError(Diagnostic(f"settings is {quoted(settings)}", "give RunSettings(…)"))
    return settings or RunSettings()


def with_option_names(text: str, names: Mapping[str, str] = FLAGS) -> str:
    """Return a message of the engine with the options of a surface in place of `RunSettings.NAME`.

    names  options by the name of the setting; a setting without one keeps the name that it has in Python
    """
    return _SETTING.sub(lambda match: names.get(match[1], match[0]), text)


def diagnostic_with_option_names(diagnostic: Diagnostic, names: Mapping[str, str] = FLAGS) -> Diagnostic:
    """Return a diagnostic with the options of a surface in its texts, as `with_option_names`."""
    keys = ("message", "hint", "source")
    texts: dict[str, Any] = {key: with_option_names(getattr(diagnostic, key), names) for key in keys}
    return replace(diagnostic, **texts)
