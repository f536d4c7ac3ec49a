"""Output of the command line: streams, errors, warnings and exit codes. A traceback is printed on request only."""

from __future__ import annotations

import os
import re
import shlex
import sys
import traceback
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

import typer
from typer.core import TyperGroup

from eidrive_scenario.errors import (
    ABORTED,
    INVALID_INPUT,
    Diagnostic,
    EidriveError,
    ExtensionError,
    InputError,
    SimulationError,
    in_one_line,
    most_similar,
    quoted,
)
from eidrive_scenario.files.atomic import standard_stream
from eidrive_scenario.files.encodable import printable


def make_writable() -> None:
    """Make all messages writable: missing characters as `\\u2265`; a closed stream discards its output."""
    sys.stdout, sys.stderr = _writable(sys.stdout), _writable(sys.stderr)


def echo(message: object, *, err: bool = False, color: str = "") -> None:
    """Print a line on stdout or stderr. All commands print by this function, or by `console` of `verdicts`.

    Settings have the names of their options. Control characters are escaped, as names and messages of files may contain
    them.
    """
    text = printable(_with_option_names(str(message)))
    typer.echo(typer.style(text, fg=color) if color else text, err=err)


def echo_path(path: str | os.PathLike[str], *, err: bool = False) -> None:
    """Print the path of a written file on stdout, or on stderr if the file is stdout itself."""
    echo(in_one_line(os.fspath(path)), err=err or standard_stream(path) is not None)


def _with_option_names(text: str) -> str:
    if "RunSettings." not in text:
        return text
    from eidrive_scenario.run_options import with_option_names  # late, as help and version do without the options

    return with_option_names(text)


def flush_output() -> None:
    """Write the buffered output and errors. What fails is discarded, so that the flush at exit does not fail again:
    raise OSError."""
    failures = []
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            failures.append(error)
    if failures:
        raise failures[0]


def _writable(stream: TextIO | None) -> TextIO:
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")
    return stream


def has_all_characters() -> bool:
    """True if the encoding of standard output contains all characters."""
    return (getattr(sys.stdout, "encoding", None) or "utf-8").lower().replace("-", "") in ("utf8", "utf16", "utf32")


_INTERRUPTED, BROKEN_PIPE = 130, 141
"""Exit codes of shells: 128 + SIGINT, 128 + SIGPIPE."""


class Guarded(TyperGroup):
    """Group of commands that converts errors into messages on stderr and exit codes."""

    def invoke(self, ctx: Any) -> Any:
        """Run the selected command."""
        try:
            return super().invoke(ctx)
        except InputError as error:
            for diagnostic in error.diagnostics:
                echo(str(diagnostic), err=True)
            print_unused_projects(error.diagnostics)
            raise typer.Exit(INVALID_INPUT) from error
        except KeyboardInterrupt as error:
            echo("interrupted", err=True)
            print_notes(error)
            raise typer.Exit(_INTERRUPTED) from error
        except (Exception, SystemExit) as error:
            if _from_typer(error):
                _restate_choice(error)
                raise
            # The reader, for example `head`, closed the pipe; rich replaces the error by the exit of a failed run.
            if isinstance(error.__context__ if isinstance(error, SystemExit) else error, BrokenPipeError):
                with suppress(OSError):
                    flush_output()
                raise typer.Exit(BROKEN_PIPE) from error
            if isinstance(error, SystemExit) and _is_of_command(error):
                raise
            (show_traceback if ctx.params.get("traceback") else print_error)(error)
            with suppress(OSError):
                flush_output()
            raise typer.Exit(ABORTED) from error


_CHOICE = re.compile(r"Value error, '(.*)' is not one of (.*)\.", re.DOTALL)


def _restate_choice(error: BaseException) -> None:
    """Replace the message of typer about an unknown value of a list by one with the most similar value."""
    match = _CHOICE.fullmatch(str(getattr(error, "message", "")))
    if match is not None:
        word, choices = match[1], re.findall(r"'([^']*)'", match[2])
        similar = most_similar(word, choices)
        hint = f"known: {', '.join(choices)}" if similar is None else f"did you mean {similar!r}?"
        error.message = f"unknown value {quoted(word)}; {hint}"  # type: ignore[attr-defined]


def print_error(error: BaseException, what: str = "run", file: object = None) -> None:
    """Print an error on stderr: an aborted run, check or judgement, an error of the operating system, or an internal
    error.

    what  run, check or judgement; omitted from the message of an error outside, such as an extension that does not load
    file  file whose check or judgement was aborted; None for a run
    """
    prefix = f"{in_one_line(file)}: " if file is not None else ""
    error = _attribute(error)
    if isinstance(error, EidriveError):
        subject = f"{what} " if isinstance(error, SimulationError) or file is not None else ""
        echo(f"{prefix}{subject}aborted: {error}", err=True)
    elif isinstance(error, OSError) and error.strerror:
        filename = f": {in_one_line(error.filename)}" if error.filename is not None else ""
        echo(f"{prefix}aborted: {error.strerror}{filename}", err=True)
    else:
        echo(f"{prefix}internal error: {type(error).__name__}: {error}", err=True)
        echo("eidrive --traceback … (or EIDRIVE_TRACEBACK=1) prints the traceback; please report it", err=True)
    print_notes(error)


def print_unused_projects(diagnostics: Iterable[Diagnostic]) -> None:
    """Print on stderr which projects and tests may define unknown extensions, if these extensions are not used.

    They are not imported for their files alone, because scenarios of others must not execute code.
    """
    from eidrive_scenario.extensions.project import GROUPS, conftest_above, unused_project
    from eidrive_scenario.extensions.registry import singular

    unknown = tuple(f"unknown {kind} " for kind in (*map(singular, GROUPS), "channel model"))
    sources = dict.fromkeys(
        diagnostic.source for diagnostic in diagnostics if diagnostic.source and diagnostic.message.startswith(unknown)
    )
    notices: dict[str, None] = {}
    for path in map(Path, sources):
        if (folder := unused_project(path)) is not None:
            option = f"--project {shlex.quote(str(folder))}"
            notices[f"{folder}: extensions of this project are used only there, or with eidrive {option}"] = None
        elif (conftest := conftest_above(path)) is not None:
            name = "modules of the table tool.eidrive in pyproject.toml"
            notices[f"{conftest}: only pytest knows extensions that it registers; name the module in {name}"] = None
    for notice in notices:
        echo(notice, err=True)


def show_traceback(error: BaseException) -> None:
    """Print the traceback of an error on stderr."""
    echo("".join(traceback.format_exception(error)).rstrip(), err=True)


def print_notes(error: BaseException) -> None:
    """Print the notes of an error of a run: the command that reproduces the run, and the path of its recording."""
    for note in getattr(error, "__notes__", ()):
        echo(note, err=True)


def print_warnings(warnings: Iterable[str]) -> None:
    """Print warnings on stderr, one per line."""
    for warning in warnings:
        print_warning(warning)


def print_warning(warning: str) -> None:
    """Print a warning on stderr."""
    echo(f"warning: {warning}", color="yellow", err=True)


def _attribute(error: BaseException) -> BaseException:
    """Return the error, or the ExtensionError of the extension that raised it."""
    if isinstance(error, EidriveError):
        return error
    from eidrive_scenario.simulation.attribution import report_extension

    try:
        report_extension(error)
    except ExtensionError as attributed:
        return attributed
    return error


def _is_of_command(error: BaseException) -> bool:
    """Return whether a command of another package raised the error."""
    attributed = _attribute(error)
    return isinstance(attributed, ExtensionError) and attributed.place.kind == "command"


def _from_typer(error: BaseException) -> bool:
    """True for exits and usage errors, which typer prints. Newer versions of typer contain their own copy of click."""
    return any(kind.__module__.split(".")[0] in ("typer", "click") for kind in type(error).__mro__)
