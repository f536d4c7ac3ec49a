"""Options of commands: those of a run, help that fits on a screen, and checks of values and output paths."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial, wraps
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.recording.run_files import RecordMode
from eidrive_scenario.run_options import RunOption, RunSettings, options_of

RARE = "Further options"
"""Panel of the options that only `--help-all` describes."""
rare = partial(typer.Option, rich_help_panel=RARE)
"""Define an option of this panel, as `typer.Option` does."""
_DESCRIBED = "eidrive_scenario.cli.options"
"""Key of the context under which `--help-all` is stored."""


class Command(TyperCommand):
    """Command that refuses an empty text as a folder of its output, which would be the current folder."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments. Raise SettingError for an empty folder."""
        given, _, _ = self.make_parser(ctx).parse_args(args=[*args])  # typer itself replaces the empty path by `.`
        for option in self.params:
            flag = next((flag for flag in option.opts if flag in _FOLDERS), None)
            if flag is not None and given.get(option.name) == "":
                raise SettingError(Diagnostic(f"{flag} is an empty path", "give . for the current folder"))
        return super().parse_args(ctx, args)


_FOLDERS = ("--out", "--figures")
"""Options of folders. A file with an empty path cannot be written anyway."""


class ShortHelp(Command):
    """Command whose help names the options of panel `RARE` in its last lines, and describes them with `--help-all`."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        hidden = [option for option in self.params if getattr(option, "rich_help_panel", None) == RARE]
        described = bool(ctx.meta.get(_DESCRIBED))
        for option in hidden:
            option.hidden = not described  # type: ignore[attr-defined]
        names = " ".join(option.opts[0] for option in hidden)
        self.epilog = None if described else f"{RARE} (see --help-all): {names}"
        super().format_help(ctx, formatter)


def _describe_all(ctx: typer.Context, requested: bool) -> None:
    if requested:
        ctx.meta[_DESCRIBED] = True
        typer.echo(ctx.get_help())
        raise typer.Exit


HelpAll = Annotated[
    bool, typer.Option("--help-all", callback=_describe_all, is_eager=True, help="Show all options and exit.")
]
"""Option of commands of the class `ShortHelp`."""


def takes_run_options(
    command: str, *, at: str, before: Mapping[str, str]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a command take the options of a run that the table `eidrive_scenario.run_options` gives it.

    command  name of the command in the table
    at       parameter of the command before which the options are in its help
    before   other places of single options: the name of the parameter or option before which each is

    The decorated function gets their values as its parameter `settings`, RunSettings.
    """
    options = options_of(command)

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        own = dict(inspect.signature(function, eval_str=True).parameters)
        del own["settings"]
        parameters: dict[str, inspect.Parameter] = {}

        def add_options_before(name: str) -> None:
            for option in options:
                if before.get(option.name, at) == name:
                    add_options_before(option.name)
                    parameters[option.name] = _parameter(option)

        for name, parameter in own.items():
            add_options_before(name)
            parameters[name] = parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)

        @wraps(function)
        def call(**given: Any) -> None:
            values = {option.name: option.form.parse(option.flag, given.pop(option.name)) for option in options}
            function(settings=RunSettings(**values), **given)

        call.__signature__ = inspect.Signature(list(parameters.values()))  # type: ignore[attr-defined]
        call.__annotations__ = {name: parameter.annotation for name, parameter in parameters.items()}
        return call

    return decorate


def _parameter(option: RunOption) -> inspect.Parameter:
    """Return the parameter of a command for an option of a run."""
    described = typer.Option(
        option.flag,
        metavar=option.metavar or option.form.metavar,
        help=option.help,
        envvar=option.envvar,
        rich_help_panel=RARE if option.rare else None,
    )
    annotated: Any = Annotated
    default = None if option.form.is_repeated else option.default
    return inspect.Parameter(
        option.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=default,
        annotation=annotated[option.form.parameter, described],
    )


Record = Annotated[RecordMode | None, rare(help="Runs whose recording and images --out keeps.", show_default="always")]


def check_record(record: RecordMode | None, out: Path | None) -> None:
    """Raise SettingError for `--record` without `--out`."""
    if record is not None and out is None:
        raise SettingError(Diagnostic("--record without --out has no effect", "add --out DIR"))


STANDARD_OUTPUT = "-"
"""Value of `--log` for standard output. All other options refuse it, as a file of this name is rarely meant."""
MOST_SEEDS = 1_000_000
"""Maximum number of seeds of an option."""
_SEEDS = re.compile(r"(\d{1,40})(?:-(\d{1,40}))?")
_SHARD = re.compile(r"(\d{1,9})/(\d{1,9})")
"""Patterns of limited length: Python does not convert texts of thousands of digits to integers."""


def parse_seeds(text: str) -> list[int]:
    """Return the seeds of `--seeds`, a text such as `1-10`, `3` or `1,2,5-8`. Raise SettingError for another text."""
    seeds: list[int] = []
    for part in text.split(","):
        match = _SEEDS.fullmatch(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match is not None else (1, 0)
        if last < first:
            raise SettingError(Diagnostic(f"--seeds: no seeds (got {quoted(text)}; expected 1-10 or 1,2,5)"))
        if len(seeds) + last - first >= MOST_SEEDS:
            raise SettingError(Diagnostic(f"--seeds: more than {MOST_SEEDS} seeds (got {quoted(text)})"))
        seeds += range(first, last + 1)
    return seeds


def parse_shard(text: str) -> tuple[int, int]:
    """Return number and count of `2/8`. Raise SettingError unless the number is within 1 … count."""
    match = _SHARD.fullmatch(text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        message = f"--shard: no part of a whole (got {quoted(text)}; expected I/N, from 1/N to N/N)"
        raise SettingError(Diagnostic(message))
    return int(match[1]), int(match[2])


def check_output_paths(written: Mapping[str, str | Path | None], read: Iterable[str | Path | None]) -> None:
    """Raise SettingError if an output path is `-` or an input file, or if two options name the same file.

    written  output paths by option; None for an omitted option
    read     input files; other values of options, such as the name of a profile, are ignored
    """
    inputs = {os.path.realpath(path) for path in read if path is not None and os.path.isfile(path)}
    taken: dict[str, str] = {}
    for option, path in written.items():
        if str(path) == STANDARD_OUTPUT:
            raise SettingError(
                Diagnostic(f"{option}: - is not a path", "give a path; that of standard output is /dev/stdout")
            )
        if path is None or (os.path.exists(path) and not os.path.isfile(path)):
            continue
        real = os.path.realpath(path)
        if real in inputs:
            raise SettingError(Diagnostic(f"{option} would overwrite an input file", "choose another path", str(path)))
        if real in taken:
            message = f"{taken[real]} and {option} name the same file"
            raise SettingError(Diagnostic(message, "give two different files", str(path)))
        taken[real] = option
