"""Lines of criteria in scenario files, for annotations."""

from __future__ import annotations

import re
from pathlib import Path

from eidrive_scenario.files.bounded import MIB, read_regular_file

_COMMAND = "eidrive.criterion"
_END = "</CustomCommandAction>"
_MAX_BYTES = 16 * MIB


def line_of_criterion(file: Path, name: str) -> int | None:
    """Return the line of the first command that declares criteria and contains the name, from 1; None without one."""
    try:
        lines = read_regular_file(file, _MAX_BYTES).decode(errors="replace").splitlines()
    except (OSError, ValueError):
        return None
    word = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
    is_inside = False
    for number, line in enumerate(lines, 1):
        is_inside = is_inside or _COMMAND in line
        if is_inside and word.search(line.partition(_COMMAND)[2] if _COMMAND in line else line):
            return number
        if _END in line:
            is_inside = False
    return None
