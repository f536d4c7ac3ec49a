"""Output on the standard streams: control characters, closed streams, and encodings that lack characters."""

from __future__ import annotations

import os
import sys
from typing import TextIO

import typer

from eidrive_scenario.files.encodable import printable


def make_writable() -> None:
    """Make all messages writable: missing characters as `\\u2265`; a closed stream discards its output."""
    sys.stdout, sys.stderr = _writable(sys.stdout), _writable(sys.stderr)


def echo(message: object, *, err: bool = False, color: str = "") -> None:
    """Print a line on stdout or stderr. All commands print by this function, or by `console` of `verdicts`.

    Control characters are escaped, as names and messages of files may contain them.
    """
    text = printable(str(message))
    typer.echo(typer.style(text, fg=color) if color else text, err=err)


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
