"""The library of scenarios, channel profiles and weather presets that travels with the engine."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.files.bounded import MIB, absolute, is_folder, is_regular_file, read_regular_file
from eidrive_scenario.files.untrusted_xml import first_elements

Kind = Literal["channels", "weather"]
Definition = Literal["scenario", "catalog", "distribution", "roads", "unreadable", "other"]

_SUFFIX = ".xosc"
_LARGEST = 256 * MIB
_LOOKED_AT = 100_000
"""Elements of a file within which it is told what the file defines."""

LIBRARY_FOLDER = "eidrive_library"
"""First part of the paths by which scenario files of any folder name what lies in the library."""


def library_path() -> Path:
    """The library's folder: package data of an installed wheel, `xosc` in a checkout. Raises SettingError."""
    package = Path(__file__).parent
    for folder in (package / "library", package.parent / "xosc"):
        if folder.is_dir():
            return folder
    raise SettingError(Diagnostic("the scenario library is missing", "install the package again", str(package)))


def scenarios() -> list[str]:
    """Names of the library's scenarios, such as `coop/scenario_1`, sorted."""
    root = library_path()
    return sorted(
        path.relative_to(root).with_suffix("").as_posix()
        for path in root.rglob(f"*{_SUFFIX}")
        if definition(path) == "scenario"
    )


def resolve_scenario(name: str | Path) -> Path:
    """The file of a scenario given by path or by library name; a file wins over a library's scenario of that name.

    Raises SettingError, with the nearest name, if there is neither.
    """
    path = Path(name)
    if is_regular_file(path):
        _check_letters(path)
        return path
    inside = _inside(path)
    if inside is not None:
        return inside
    if str(name) and is_folder(path):
        raise SettingError(Diagnostic(f"{quoted(str(name))} is a folder", "give one .xosc file"))
    hint = suggestion(str(name).removesuffix(_SUFFIX), scenarios())
    raise SettingError(Diagnostic(f"no scenario {quoted(str(name))}: neither a file nor in the library", hint))


def from_library(name: str | Path) -> Path:
    """The file of the library's scenario of that name; the path itself if it is a file or no such name."""
    path = Path(name)
    return path if is_regular_file(path) else _inside(path) or path


def _inside(path: Path) -> Path | None:
    if path.is_absolute() or not path.name or ".." in path.parts:
        return None
    inside = library_path() / path
    for candidate in (inside.with_name(inside.name + _SUFFIX), inside):
        if is_regular_file(candidate) and candidate.suffix == _SUFFIX:
            return candidate
    return None


def place_of(path: str | Path, folder: Path) -> Path:
    """The place of a path that a file in `folder` names.

    A path that begins with `eidrive_library/` is that of a copy of the library beside the file; without such a copy it
    leads into the library itself, never out of it. Any other path counts from the folder.
    """
    named = Path(path)
    beside = folder / named
    if named.parts[:1] != (LIBRARY_FOLDER,) or ".." in named.parts or os.path.lexists(beside):
        return beside
    inside = library_path().joinpath(*named.parts[1:])
    return inside if os.path.exists(inside) else beside


def name_of(path: Path) -> str:
    """The library's name of a scenario file, such as `coop/scenario_1`; the file's own name for any other."""
    try:
        return absolute(path).relative_to(absolute(library_path())).with_suffix("").as_posix()
    except ValueError:
        return path.stem


def names(kind: Kind) -> list[str]:
    """Names of the library's channel profiles or weather presets, sorted."""
    return sorted(path.stem for path in (library_path() / kind).glob("*.yaml"))


def resolve(kind: Kind, name: str | Path) -> Path:
    """The file of a channel profile or weather preset given by path or name. Raises SettingError, with the nearest."""
    path = Path(name)
    if is_regular_file(path):
        return path
    inside = library_path() / kind / f"{name}.yaml"
    if is_regular_file(inside):
        return inside
    singular = "channel profile" if kind == "channels" else "weather preset"
    hint = suggestion(str(name), names(kind))
    raise SettingError(Diagnostic(f"no {singular} {quoted(str(name))}: neither a file nor in the library", hint))


def _check_letters(path: Path) -> None:
    """Raises SettingError for a path with bytes that are no letters: neither XML nor JSON could name it."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        shown = os.fsencode(path).decode(errors="backslashreplace")
        hint = "rename it, or set a locale with UTF-8, such as LANG=C.UTF-8"
        raise SettingError(Diagnostic("the name has bytes that are no letters here", hint, shown)) from None


def definition(path: Path) -> Definition:
    """What an OpenSCENARIO file defines, by its first elements, read without entities and network.

    `roads` is OpenDRIVE, `other` any other XML; `unreadable` is no XML before that could be told.
    """
    kinds: dict[str, Definition] = {
        "Catalog": "catalog",
        "ParameterValueDistribution": "distribution",
        "RoadNetwork": "scenario",
        "Entities": "scenario",
        "Storyboard": "scenario",
    }
    found: list[Definition] = []

    def visit(depth: int, word: str) -> bool:
        if depth == 1 and word != "OpenSCENARIO":
            found.append("roads" if word == "OpenDRIVE" else "other")
        elif depth == 2 and word in kinds:
            found.append(kinds[word])
        return bool(found)

    try:
        content = read_regular_file(path, _LARGEST)
        return found[0] if first_elements(content, _LOOKED_AT, visit) else "scenario"
    except (OSError, ValueError):
        return "unreadable"
