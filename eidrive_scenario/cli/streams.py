"""Standard streams that are closed, or whose encoding lacks characters."""

from __future__ import annotations

import os
import sys
from typing import TextIO


def make_writable() -> None:
    """Make all messages writable: missing characters as `\\u2265`; a closed stream discards its output."""
    sys.stdout, sys.stderr = _writable(sys.stdout), _writable(sys.stderr)


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
