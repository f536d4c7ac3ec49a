"""Command `eidrive`. Each command imports its modules when it is executed, so that `--help` is fast.

Exit codes: 0 passed, 1 a criterion failed, 2 invalid input, 3 the run was aborted or reached its time limit.
"""

from __future__ import annotations

import gc
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from eidrive_scenario.cli.check import check
from eidrive_scenario.cli.compare import compare
from eidrive_scenario.cli.error_output import Guarded, print_error
from eidrive_scenario.cli.init import init
from eidrive_scenario.cli.judge import judge
from eidrive_scenario.cli.reproduce import reproduce
from eidrive_scenario.cli.run import run
from eidrive_scenario.cli.short_help import ShortHelp
from eidrive_scenario.cli.show import list_names, report, tree, view
from eidrive_scenario.cli.streams import make_writable
from eidrive_scenario.cli.supervision import allow
from eidrive_scenario.cli.sweep import results, sweep
from eidrive_scenario.exit_codes import ABORTED

app = typer.Typer(
    name="eidrive",
    cls=Guarded,
    help="Run OpenSCENARIO files with cooperative perception, and evaluate them.\n\n"
    "Example: eidrive run coop/scenario_1",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command(cls=ShortHelp)(run)
app.command()(check)
app.command(name="list")(list_names)
app.command()(tree)
app.command()(view)
app.command()(judge)
app.command()(report)
app.command(cls=ShortHelp)(sweep)
app.command()(results)
app.command()(compare)
app.command()(reproduce)
app.command()(init)


def _show_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        typer.echo(f"eidrive-scenario {version('eidrive-scenario')}")
        raise typer.Exit


@app.callback()
def _options(
    traceback: Annotated[
        bool, typer.Option("--traceback", envvar="EIDRIVE_TRACEBACK", help="Show the traceback of an internal error.")
    ] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Select the project of the current folder. `Guarded` and `_show_version` evaluate the options."""
    from eidrive_scenario.project import select_project

    with suppress(FileNotFoundError):  # The current folder is deleted
        select_project(Path.cwd())


_COLLECT_AFTER = 50_000
"""Objects after which garbage is collected. The default of 700 takes a tenth of a short run, as imports create many."""


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
