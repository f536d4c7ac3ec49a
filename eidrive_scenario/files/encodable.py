"""Texts that can be written as UTF-8, and texts that a terminal shows without executing them."""

from __future__ import annotations

import re

_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
"""Control characters C0 and C1 except tab and newline, and those that break lines or change the direction of text."""


def encodable(text: str) -> str:
    """Return a text with escapes such as `\\udcff` instead of lone surrogates, which UTF-8 cannot represent.

    Names of files whose bytes are not UTF-8 have them, and so do messages of exceptions about these files.
    """
    return text.encode(errors="backslashreplace").decode()


def printable(text: str) -> str:
    """Return a text for a terminal, with escapes such as `\\u001b` instead of control characters.

    Names in scenarios, recordings and stores may contain sequences that a terminal executes. In JSON the escapes have
    the same meaning as the characters.
    """
    return _CONTROL.sub(lambda match: f"\\u{ord(match[0]):04x}", text)
