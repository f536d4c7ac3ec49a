"""How the command line fails: what is wrong with the input by file and line, and never a traceback unasked."""

from __future__ import annotations

import os
import sys
import traceback
from typing import Any

import typer
from typer.core import TyperGroup

from eidrive_scenario.errors import EidriveError, ExtensionError, InputError

WRONG_INPUT, BROKEN = 2, 3
_INTERRUPTED, _NOBODY_READS = 130, 141
"""As a shell reports them: 128 + SIGINT, 128 + SIGPIPE."""


class Guarded(TyperGroup):
    """A group of commands that turns errors into messages on stderr and exit codes."""

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command."""
        try:
            return super().invoke(ctx)
        except InputError as error:
            for diagnostic in error.diagnostics:
                typer.echo(str(diagnostic), err=True)
            raise typer.Exit(WRONG_INPUT) from error
        except KeyboardInterrupt as error:
            typer.echo("interrupted", err=True)
            tell_notes(error)
            raise typer.Exit(_INTERRUPTED) from error
        except BrokenPipeError as error:
            # The reader, say `head`, has enough. Python would complain once more when it flushes at the end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(_NOBODY_READS) from error
        except (Exception, SystemExit) as error:
            if _from_typer(error):
                raise
            (show_traceback if ctx.params.get("traceback") else print_error)(error)
            raise typer.Exit(BROKEN) from error


def print_error(error: BaseException, file: object = None) -> None:
    """Say on stderr what broke in a few words: the run, what the system refused, or an error of this program's own.

    file  file whose check broke; None for a run
    """
    place = f"{file}: " if file is not None else ""
    error = _attributed(error)
    if isinstance(error, EidriveError):
        typer.echo(f"{place}the {'run' if file is None else 'check'} broke: {error}", err=True)
        tell_notes(error)
        return
    if isinstance(error, OSError) and error.strerror:
        where = f": {error.filename}" if error.filename is not None else ""
        typer.echo(f"{place}broken off: {error.strerror}{where}", err=True)
        tell_notes(error)
        return
    typer.echo(f"{place}internal error: {type(error).__name__}: {error}", err=True)
    typer.echo("eidrive --traceback … (or EIDRIVE_TRACEBACK=1) shows where; please report it", err=True)
    tell_notes(error)


def show_traceback(error: BaseException) -> None:
    """Print on stderr where an error arose."""
    typer.echo("".join(traceback.format_exception(error)).rstrip(), err=True)


def tell_notes(error: BaseException) -> None:
    """Print what a run adds to its error: the command that reproduces it, and the path of its recording."""
    for note in getattr(error, "__notes__", ()):
        typer.echo(note, err=True)


def _attributed(error: BaseException) -> BaseException:
    """The error, or that of the extension which raised it."""
    if isinstance(error, EidriveError):
        return error
    from eidrive_scenario.simulation.attribution import report_extension

    try:
        report_extension(error)
    except ExtensionError as found:
        return found
    return error


def _from_typer(error: BaseException) -> bool:
    """Exits and usage errors, which typer shows itself; it brings its own copy of click in newer versions."""
    return any(kind.__module__.split(".")[0] in ("typer", "click") for kind in type(error).__mro__)
