"""Command `eidrive`. Each command is imported when it is executed, as the imports of all take longer than a short one.

Exit codes: 0 passed, 1 a criterion failed, 2 invalid input, 3 the run was aborted or reached its time limit, 4 no
criterion judges the run.
"""

from __future__ import annotations

import gc
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from eidrive_scenario import __version__
from eidrive_scenario.cli.command_table import CommandTable
from eidrive_scenario.cli.error_output import Guarded, print_error
from eidrive_scenario.cli.streams import echo, make_writable
from eidrive_scenario.cli.supervision import allow
from eidrive_scenario.exit_codes import ABORTED


class _Commands(Guarded):
    """Group of all commands."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = CommandTable()  # type: ignore[assignment]

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands."""
        return list(self.commands)


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
    """Select the project, by default that of the current folder. `Guarded` and `_show_version` evaluate the others."""
    from eidrive_scenario.cli.streams import echo
    from eidrive_scenario.project import enter_project, select_project

    with suppress(FileNotFoundError):  # The current folder is deleted
        if project is not None:
            if notice := enter_project(project):
                echo(notice, err=True)
            return
        select_project(Path.cwd())


_COLLECT_AFTER = 200_000
"""Objects after which garbage is collected. A short run creates fewer; a collection of half of them takes 20 ms."""


def main() -> None:
    """Run the command line and end the process with its exit code."""
    gc.set_threshold(_COLLECT_AFTER)
    make_writable()
    allow()
    try:
        app()
    except OSError as error:
        # Help and usage errors are printed before a command runs.
        print_error(error)
        raise SystemExit(ABORTED) from error
    finally:
        # The process ends, and the system frees its memory. A last search for garbage would take 0.1 s.
        gc.freeze()
