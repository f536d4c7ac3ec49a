"""Command `eidrive`: commands of the engine, and those of other packages (entry points `eidrive_scenario.commands`).

Each command is imported when it is executed or described, as the imports of all take longer than a short one.

Exit codes: 0 passed, 1 a criterion failed, 2 invalid input, 3 the run was aborted or reached its time limit, 4 no
criterion judges the run.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.main import get_command

from eidrive_scenario import __version__
from eidrive_scenario.cli.output import BROKEN_PIPE, Guarded, echo, flush_output, make_writable, print_error
from eidrive_scenario.cli.supervision import allow
from eidrive_scenario.errors import ABORTED

if TYPE_CHECKING:
    from eidrive_scenario.extensions.registry import Registry

FUNCTIONS = {
    "run": "run:run",
    "check": "check:check",
    "list": "show:list_names",
    "tree": "show:tree",
    "draw": "show:draw",
    "view": "show:view",
    "judge": "recordings:judge",
    "export": "recordings:export",
    "dataset": "dataset:dataset",
    "report": "show:report",
    "sweep": "sweep:sweep",
    "results": "results:results",
    "compare": "results:compare",
    "schema": "schema:schema",
    "init": "init:init",
}
"""Module of this package and function of each command, in the order of the help."""
_SHORT = frozenset({"run", "check", "sweep", "dataset"})
"""Commands with options that only `--help-all` describes."""


class CommandTable(Mapping[str, Any]):
    """Commands of the command line by name, each created on its first access."""

    def __init__(self) -> None:
        self._created: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        """Return a command. Raise KeyError if none has this name."""
        if name not in self._created:
            from eidrive_scenario.cli.options import Command, ShortHelp

            if name in FUNCTIONS:  # first, so that no package replaces a command of the engine
                module, _, function = FUNCTIONS[name].partition(":")
                command = getattr(import_module(f"eidrive_scenario.cli.{module}"), function)
            elif name in _added():
                command = _added().load(name)
            else:
                raise KeyError(name)
            app = typer.Typer(add_completion=False)
            app.command(name=name, cls=ShortHelp if name in _SHORT else Command)(command)
            self._created[name] = get_command(app)
        return self._created[name]

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys([*FUNCTIONS, *_added()]))

    def __len__(self) -> int:
        return len(list(iter(self)))


def _added() -> Registry:
    """Return the commands of other packages. It is imported late: a command of the engine reads no entry points."""
    from eidrive_scenario.extensions.registry import registry

    return registry("commands")


class _Commands(Guarded):
    """Group of all commands."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = CommandTable()  # type: ignore[assignment]

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands."""
        return list(self.commands)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Select the project, by default that of the current folder, and return the command that the arguments name."""
        from eidrive_scenario.extensions.project import enter_project, select_project

        project: Path | None = ctx.params["project"]
        with suppress(FileNotFoundError):  # The current folder is deleted
            if project is None:
                select_project(Path.cwd())
            elif notice := enter_project(project):
                echo(notice, err=True)
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="eidrive",
    cls=_Commands,
    help="Run OpenSCENARIO files with cooperative perception, and evaluate them.\n\n"
    "Example: eidrive run coop/scenario_1",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(requested: bool) -> None:
    if requested:
        echo(f"eidrive-scenario {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    traceback: Annotated[
        bool, typer.Option("--traceback", envvar="EIDRIVE_TRACEBACK", help="Show the traceback of an internal error.")
    ] = False,
    project: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Run in this folder, and use the extensions of its project."),
    ] = None,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Declare the options of all commands, which `_Commands`, `Guarded` and `_show_version` evaluate."""


_COLLECT_AFTER = 200_000
"""Objects after which garbage is collected. A short run creates fewer; a collection of half of them takes 20 ms."""


def main() -> None:
    """Run the command line and end the process with its exit code."""
    gc.set_threshold(_COLLECT_AFTER)
    make_writable()
    allow()
    try:
        try:
            app()
        finally:
            flush_output()
    except BrokenPipeError as error:
        raise SystemExit(BROKEN_PIPE) from error
    except SystemExit as error:
        if isinstance(error.__context__, BrokenPipeError):  # typer ends help and version with 1
            raise SystemExit(BROKEN_PIPE) from error
        raise
    except OSError as error:
        # Help and usage errors are printed before a command runs.
        with suppress(OSError):  # Standard error is full, too
            print_error(error)
        with suppress(OSError):
            flush_output()
        raise SystemExit(ABORTED) from error
    finally:
        # The process ends, and the system frees its memory. A last search for garbage would take 0.1 s.
        gc.freeze()
