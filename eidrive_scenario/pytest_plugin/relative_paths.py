"""Paths in settings, relative to the file that contains them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any


def path_beside(source: Any, folder: Path) -> Any:
    """Return the path of a file relative to a folder, or any other value unchanged."""
    if isinstance(source, str | Path) and _is_file(folder / source):
        return folder / source
    return source


def _is_file(path: Path) -> bool:
    try:
        return os.path.isfile(path)
    except (OSError, ValueError):  # a YAML text that no file name can be
        return False
