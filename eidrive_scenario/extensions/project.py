"""Extensions of a project that is not installed, by the table `tool.eidrive` of its pyproject.toml.

    [tool.eidrive]
    pythonpath = ["."]                                  # folders with the modules of the project
    modules = ["demo_actions"]                          # modules that register extensions by `register`

    [project.entry-points."eidrive_scenario.criteria"]
    keep_gap = "demo_criteria:KeepGap"

A file without this table is not used, so that nothing of other projects is imported.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.files.bounded import MIB, read_regular_file

VARIABLE = "EIDRIVE_PROJECT"
"""Environment variable with the folder of the project, which other processes of a command inherit."""
_FILE = "pyproject.toml"
_GROUP = "eidrive_scenario."
_KEYS = ("pythonpath", "modules")
GROUPS = (
    "actions",
    "conditions",
    "criteria",
    "detectors",
    "channels",
    "fusion",
    "planners",
    "sensors",
    "controllers",
    "trackers",
    "vehicle_controllers",
    "commands",
)
"""Kinds of extensions: their entry points are in the groups `eidrive_scenario.KIND`."""


def select_project(folder: Path) -> None:
    """Use the project of a folder: the nearest pyproject.toml there or above, if it has the table `tool.eidrive`.

    A folder that `VARIABLE` already names stays. Raise SettingError if the file cannot be read or is invalid.
    """
    if VARIABLE in os.environ:
        return
    project = _project_of(folder)
    if project is not None:
        os.environ[VARIABLE] = str(project)


def selected_project() -> Path | None:
    """Return the absolute folder of the selected project, or None."""
    folder = os.environ.get(VARIABLE)
    return Path(os.path.abspath(folder)) if folder else None


def portable_path(path: str | os.PathLike[str]) -> str:
    """Return the absolute path, or the path from the folder of the selected project for a file below it.

    A command with it is valid in any folder, and after a copy of the project only the name of its folder changes.
    """
    full, project = Path(os.path.abspath(path)), selected_project()
    if project is None or not full.is_relative_to(project):
        return str(full)
    relative = full.relative_to(project).as_posix()
    return f"./{relative}" if relative.startswith("-") else relative


def enter_project(folder: Path) -> str:
    """Use the project in a folder, and make this folder the current one. Return a notice for the user, or "".

    If the folder does not exist, as with a command of another machine, the project of the current folder is used.
    Raise SettingError if there is no project.
    """
    notice = ""
    if _project_in(folder) is None:
        here = None if folder.exists() else _project_of(Path.cwd())
        if here is None:
            problem = "has no pyproject.toml with the table tool.eidrive" if folder.is_dir() else "no such folder"
            raise SettingError(Diagnostic(f"--project: {problem}", "give the folder of a project", str(folder)))
        notice = f"--project: no folder {folder}; the project of the current folder is used: {here}"
        folder = here
    os.chdir(folder)
    os.environ[VARIABLE] = os.getcwd()
    return notice


def unused_project(path: Path) -> Path | None:
    """Return the folder of the project that contains a file, if it is another one than the selected project."""
    selected = os.environ.get(VARIABLE)
    try:
        project = _project_of(path.absolute().parent)
        is_used = project is not None and selected and Path(selected).resolve() == project.resolve()
    except (OSError, ValueError, SettingError):
        return None
    return None if is_used else project


def conftest_above(path: Path) -> Path | None:
    """Return the nearest `conftest.py` in the folder of a file or above, or None."""
    try:
        folder = path.absolute().parent
        return next((file for above in (folder, *folder.parents) if (file := above / "conftest.py").is_file()), None)
    except (OSError, ValueError):
        return None


def _project_of(folder: Path) -> Path | None:
    """Return the folder of the nearest pyproject.toml there or above, if it has the table `tool.eidrive`."""
    path = next((path for above in (folder, *folder.parents) if (path := above / _FILE).is_file()), None)
    return None if path is None else _project_in(path.parent)


def _project_in(folder: Path) -> Path | None:
    """Return the folder if its pyproject.toml has the table `tool.eidrive`."""
    path = folder / _FILE
    return folder if path.is_file() and _table(path) is not None else None


def project_entry_points() -> dict[str, tuple[EntryPoint, ...]]:
    """Return the entry points of the selected project by kind, and put its folders on the path of imports.

    Raise SettingError if its pyproject.toml cannot be read or is invalid.
    """
    folder = os.environ.get(VARIABLE)
    return entry_points_of(Path(folder)) if folder else {}


@cache
def entry_points_of(folder: Path) -> dict[str, tuple[EntryPoint, ...]]:
    """Return the entry points of the project in a folder as `project_entry_points`."""
    path = folder / _FILE
    content = _table(path) or {}
    unknown = next((key for key in content.get("tool", {}).get("eidrive", {}) if key not in _KEYS), None)
    if unknown is not None:
        raise _error(path, f"unknown setting {quoted(f'tool.eidrive.{unknown}')}", suggestion(unknown, _KEYS))
    folders = _texts(path, content, "pythonpath", 'write a list of folders, such as ["."]')
    groups = content.get("project", {}).get("entry-points", {})
    by_group: dict[str, tuple[EntryPoint, ...]] = {}
    for group, points in groups.items() if isinstance(groups, dict) else ():
        if not group.startswith(_GROUP) or not isinstance(points, dict):
            continue
        kind = group.removeprefix(_GROUP)
        if kind not in GROUPS:
            raise _error(path, f"unknown group of entry points {quoted(group)}", suggestion(kind, GROUPS))
        for name, value in points.items():
            if not isinstance(value, str) or ":" not in value or EntryPoint.pattern.match(value) is None:
                raise _error(path, f"entry point {name}: {quoted(str(value))}", "write package.module:Object")
        by_group[kind] = tuple(EntryPoint(name, value, group) for name, value in points.items())
    for relative in reversed(folders):
        if (directory := str((folder / relative).resolve())) not in sys.path:
            sys.path.insert(0, directory)
    return by_group


@cache
def modules_of(folder: Path) -> tuple[str, ...]:
    """Return the names of the modules that the project in a folder imports. Raise SettingError as above."""
    path = folder / _FILE
    hint = 'write a list of modules, such as ["my_criteria"]'
    names = _texts(path, _table(path) or {}, "modules", hint)
    for name in names:
        if not all(part.isidentifier() for part in name.split(".")):
            raise _error(path, f"tool.eidrive.modules: {quoted(name)} is not the name of a module", hint)
    return tuple(names)


def _texts(path: Path, content: dict[str, Any], name: str, hint: str) -> list[str]:
    """Return a list of texts in the table `tool.eidrive`. Raise SettingError for another value."""
    texts = content.get("tool", {}).get("eidrive", {}).get(name, [])
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise _error(path, f"tool.eidrive.{name}: {quoted(str(texts))}", hint)
    return texts


def _table(path: Path) -> dict[str, Any] | None:
    """Return the content of a pyproject.toml; None if it has no table `tool.eidrive`."""
    try:
        text = read_regular_file(path, MIB).decode()
    except OSError as error:
        raise _error(path, f"cannot be read: {error.strerror}", "check its permissions") from error
    except UnicodeDecodeError as error:
        raise _error(path, "is not UTF-8", "save it as UTF-8") from error
    if "eidrive" not in text:
        return None
    import tomllib

    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _error(path, f"is not TOML: {error}", "correct it") from error
    except RecursionError as error:
        raise _error(path, "is nested too deeply", "correct it") from error
    tools = content.get("tool")
    return content if isinstance(tools, dict) and isinstance(tools.get("eidrive"), dict) else None


def _error(path: Path, message: str, hint: str) -> SettingError:
    return SettingError(Diagnostic(message, hint, str(path)))
