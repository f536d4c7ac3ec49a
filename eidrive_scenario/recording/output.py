"""Files that a run leaves behind."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from eidrive_scenario.errors import Problem, SettingError


def create(path: str | Path) -> BinaryIO:
    """A new file there, its folders too. Raises SettingError if it cannot be written."""
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        return Path(path).open("wb")
    except OSError as error:
        raise SettingError(Problem(f"cannot write: {error.strerror}", "choose another place", str(path))) from error
