"""Command `eidrive init`."""

from __future__ import annotations

import re
import shlex
from contextlib import suppress
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated

import typer

from eidrive_scenario.base.installation import requirement_source
from eidrive_scenario.cli.output import echo
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.files.bounded import absolute

TEMPLATE = "project_template"
"""Folder of the template in the package. Files are written without the suffix `.template`."""
_SUFFIX = ".template"
_LONGEST = 60
"""Maximum number of characters of the name of the package."""
_NAMES = {
    "criteria.py": "{package}_criteria.py",
    "gitignore": ".gitignore",
    "workflow.yml": ".github/workflows/scenarios.yml",
}
"""Names of files that differ from those of the template."""


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the project, without files except .git.")],
) -> None:
    """Write a project with a scenario, its road, a criterion, tests and a workflow, which pass at once.

    Example: eidrive init demo && cd demo && pytest
    """
    written: list[Path] = []
    try:
        package = _package(absolute(folder).name)
        if folder.exists() and any(path.name != ".git" for path in folder.iterdir()):
            raise SettingError(Diagnostic("the folder is not empty", "give a new folder", str(folder)))
        above = [path for path in (folder, *folder.parents) if not path.exists()]
        try:
            _write(files("eidrive_scenario") / TEMPLATE, folder, package, written)
        except OSError:
            _remove(written, folder, above)
            raise
    except OSError as error:
        raise SettingError(Diagnostic(f"cannot write: {error.strerror}", "give a new folder", str(folder))) from error
    for path in sorted(written):
        echo(path.relative_to(folder))
    start = f"./{folder}" if str(folder).startswith("-") else str(folder)
    echo("next: " + ("pytest" if folder == Path() else f"cd {shlex.quote(start)} && pytest"), err=True)


def _package(name: str) -> str:
    """Return the name of the Python package of a folder."""
    package = re.sub(r"\W+", "_", name.lower(), flags=re.ASCII).strip("_")[:_LONGEST].strip("_")
    return package if package and not package[0].isdigit() else f"project_{package}".strip("_")


def _write(source: Traversable, folder: Path, package: str, written: list[Path]) -> None:
    """Write the files of a folder of the template, and append their paths to `written`."""
    for entry in sorted(source.iterdir(), key=lambda file: file.name):
        if entry.is_dir():
            if entry.name != "__pycache__":
                _write(entry, folder / entry.name, package, written)
            continue
        bare = entry.name.removesuffix(_SUFFIX)
        path = folder / _NAMES.get(bare, bare).format(package=package)
        path.parent.mkdir(parents=True, exist_ok=True)
        text = entry.read_text(encoding="utf-8").replace("@package@", package).replace("@source@", requirement_source())
        written.append(path)
        path.write_text(text.replace("@name@", package.replace("_", "-")), encoding="utf-8")


def _remove(written: list[Path], folder: Path, above: list[Path]) -> None:
    """Remove the files of an incomplete project, and the folders that were made for them."""
    with suppress(OSError):
        for path in written:
            path.unlink(missing_ok=True)
    below = {parent for path in written for parent in path.parents if folder in parent.parents}
    for path in (*sorted(below, key=lambda directory: -len(directory.parts)), *above):
        with suppress(OSError):
            path.rmdir()
