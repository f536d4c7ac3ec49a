"""Hints for paths of files that do not exist: similar files and folders beside them."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from itertools import islice
from pathlib import Path

from eidrive_scenario.errors import most_similar, suggestion

_MOST_ENTRIES = 2000
"""Maximum number of entries of a folder with which a name is compared."""


def file_suggestion(
    given: str | os.PathLike[str],
    suffixes: Collection[str],
    names: Iterable[str] = (),
    *,
    folder: Path = Path(),
    otherwise: str = "check the path",
) -> str:
    """Return a hint for a missing file: the most similar file of its folder, or else of the known `names`.

    given      path, or one of the names with or without a suffix
    suffixes   of the files
    folder     folder of relative paths
    otherwise  hint without a similar file and without known names
    """
    similar = _similar_path(folder / given, suffixes)
    if similar is not None:
        return f"did you mean {str(similar.relative_to(folder) if similar.is_relative_to(folder) else similar)!r}?"
    candidates, path = list(names), Path(given)
    if not candidates:
        return otherwise
    word = next((str(path)[: -len(suffix)] for suffix in suffixes if path.suffix == suffix), str(given))
    beside = [str(path.parent / name) for name in _names(folder / path.parent, suffixes)]
    is_path = path.suffix in suffixes or len(path.parts) > 1
    return suggestion(word, beside if beside and is_path and most_similar(word, candidates) is None else candidates)


def _similar_path(path: Path, suffixes: Collection[str]) -> Path | None:
    """Return an existing file whose path differs from `path` by similar names only; None without one."""
    folder = next((above for above in path.parents if os.path.isdir(above)), None)
    if folder is None:
        return None
    *missing, last = path.relative_to(folder).parts
    for part in missing:
        name = part if os.path.isdir(folder / part) else most_similar(part, _names(folder, ()))
        if name is None:
            return None
        folder /= name
    if missing and os.path.isfile(folder / last):
        return folder / last
    name = most_similar(last, _names(folder, suffixes))
    return None if name is None else folder / name


def _names(folder: Path, suffixes: Collection[str]) -> list[str]:
    """Return the names of the files with these suffixes, or of the folders without suffixes."""
    try:
        with os.scandir(folder) as entries:
            return sorted(
                entry.name
                for entry in islice(entries, _MOST_ENTRIES)
                if (Path(entry.name).suffix in suffixes and entry.is_file() if suffixes else entry.is_dir())
            )
    except (OSError, ValueError):
        return []
