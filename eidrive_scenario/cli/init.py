"""Command `eidrive init`."""

from __future__ import annotations

import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated

import typer

from eidrive_scenario.errors import Diagnostic, SettingError

TEMPLATE = "project_template"
"""Folder of the template in the package. Files are written without the suffix `.template`."""
_SUFFIX = ".template"
_NAMES = {
    "criteria.py": "{package}_criteria.py",
    "gitignore": ".gitignore",
    "workflow.yml": ".github/workflows/scenarios.yml",
}
"""Names of files that differ from those of the template."""


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the project; it must not have files yet.")],
) -> None:
    """Write a project with a scenario, its road, a criterion, tests and a workflow, which pass at once.

    Example: eidrive init demo && cd demo && pytest
    """
    name = folder.resolve().name
    package = re.sub(r"\W+", "_", name.lower(), flags=re.ASCII).strip("_")
    if not package or package[0].isdigit():
        package = f"project_{package}".strip("_")
    try:
        if folder.exists() and any(folder.iterdir()):
            raise SettingError(Diagnostic("the folder is not empty", "give a new folder", str(folder)))
        written = _write(files("eidrive_scenario") / TEMPLATE, folder, package)
    except OSError as error:
        raise SettingError(Diagnostic(f"cannot write: {error.strerror}", "give a new folder", str(folder))) from error
    for path in sorted(written):
        typer.echo(path.relative_to(folder))
    typer.echo(f"next: cd {folder} && pytest", err=True)


def _write(source: Traversable, folder: Path, package: str) -> list[Path]:
    """Write the files of a folder of the template, and return their paths."""
    written = []
    for entry in sorted(source.iterdir(), key=lambda one: one.name):
        if entry.is_dir():
            if entry.name != "__pycache__":
                written += _write(entry, folder / entry.name, package)
            continue
        bare = entry.name.removesuffix(_SUFFIX)
        path = folder / _NAMES.get(bare, bare).format(package=package)
        path.parent.mkdir(parents=True, exist_ok=True)
        text = entry.read_text(encoding="utf-8").replace("@package@", package)
        path.write_text(text.replace("@name@", package.replace("_", "-")), encoding="utf-8")
        written.append(path)
    return written
