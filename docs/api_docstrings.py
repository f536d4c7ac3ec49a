"""Conversion of docstrings of the project to reStructuredText.

Docstrings are plain text: names in single backticks, and lists of a name, two spaces and a description.
"""

from __future__ import annotations

import re

_ENTRY = re.compile(r"(?P<name>\S(?:[^ ]| (?! ))*) {2,}(?P<text>\S.*)")
_CODE = re.compile(r"(?<![`\\])`([^`]+)`(?![`_])")
_SPECIAL = re.compile(r"(?<![\\`])([*|]|_(?=\W|$))")


def to_rest(lines: list[str]) -> list[str]:
    """Return the lines of a docstring as reStructuredText."""
    found: list[str] = []
    in_list = False
    for line in lines:
        text = line.rstrip()
        entry = _ENTRY.fullmatch(text.strip())
        if entry is not None and not text.startswith(" "):
            if not in_list and found and found[-1]:
                found.append("")
            found += [f"``{entry['name']}``", f"    {_inline(entry['text'])}"]
            in_list = True
        elif in_list and text.startswith(" "):
            found.append(f"    {_inline(text.strip())}")
        else:
            if in_list and text and found[-1]:
                found.append("")
            in_list = in_list and not text
            found.append(_inline(text))
    return found


def _inline(text: str) -> str:
    """Return text with its special characters escaped and its names as literals."""
    parts = _CODE.split(text)
    return "".join(f"``{part}``" if index % 2 else _SPECIAL.sub(r"\\\1", part) for index, part in enumerate(parts))
