"""Standard output and error as this process finds them: closed, or in an encoding that lacks letters."""

from __future__ import annotations

import os
import sys
from typing import TextIO


def make_writable() -> None:
    """Let every message be written: what the encoding lacks as `\\u2265`, and nowhere where the stream is closed."""
    sys.stdout, sys.stderr = _writable(sys.stdout), _writable(sys.stderr)


def _writable(stream: TextIO | None) -> TextIO:
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")
    return stream


def has_all_letters() -> bool:
    """Whether standard output can write whatever a text may contain."""
    return (getattr(sys.stdout, "encoding", None) or "utf-8").lower().replace("-", "") in ("utf8", "utf16", "utf32")
