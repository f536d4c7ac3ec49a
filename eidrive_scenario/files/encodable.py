"""Texts that can be written as UTF-8."""

from __future__ import annotations


def encodable(text: str) -> str:
    """Return a text with escapes such as `\\udcff` instead of lone surrogates, which UTF-8 cannot represent.

    Names of files whose bytes are not UTF-8 have them, and so do messages of exceptions about these files.
    """
    return text.encode(errors="backslashreplace").decode()
