"""Library of scenarios, channel profiles and weather presets that is distributed with the engine."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.files.bounded import MIB, absolute, is_regular_file, path_argument, read_regular_file
from eidrive_scenario.files.similar_paths import file_suggestion
from eidrive_scenario.files.untrusted_xml import first_elements

Kind = Literal["channels", "weather"]
Definition = Literal["scenario", "catalog", "distribution", "roads", "unreadable", "other"]

SCENARIO_SUFFIX = ".xosc"
"""Suffix of scenarios, catalogs and distributions."""
ROADS_SUFFIX = ".xodr"
"""Suffix of road files."""
_MAX_BYTES = 256 * MIB
_MAX_ELEMENTS = 100_000
"""Maximum number of elements that are read to determine the definition of a file."""

LIBRARY_FOLDER = "eidrive_library"
"""First part of the paths with which scenario files in any folder refer to the library."""
CATALOGS = "catalogs"
"""Folder of the catalogs in the library."""


def library_path() -> Path:
    """Return the folder of the library: package data of an installed wheel, `xosc` in a checkout.

    Raise SettingError if there is none.
    """
    package = Path(__file__).parents[1]
    for folder in (package / "library", package.parent / "xosc"):
        if folder.is_dir():
            return folder
    raise SettingError(Diagnostic("the scenario library is missing", "install the package again", str(package)))


def scenarios() -> list[str]:
    """Return the sorted names of the scenarios in the library, such as `coop/scenario_1`."""
    root = library_path()
    return sorted(
        path.relative_to(root).with_suffix("").as_posix()
        for path in root.rglob(f"*{SCENARIO_SUFFIX}")
        if definition(path) == "scenario"
    )


@dataclass(frozen=True)
class LibraryScenario:
    """Scenario of the library: its name, the folder that contains it, and the description in its header on one line."""

    name: str
    family: str
    description: str


def describe_scenarios() -> list[LibraryScenario]:
    """Return the scenarios of the library, sorted by name."""
    root = library_path()
    return [
        LibraryScenario(name, name.rpartition("/")[0], _description(root / f"{name}{SCENARIO_SUFFIX}"))
        for name in scenarios()
    ]


def _description(path: Path) -> str:
    """Return the description in the FileHeader of a scenario without line breaks and control characters."""
    descriptions: list[str] = []

    def visit(_: int, tag: str, attributes: Mapping[str, str]) -> bool:
        if tag == "FileHeader":
            descriptions.append(attributes.get("description", ""))
        return bool(descriptions)

    try:
        first_elements(read_regular_file(path, _MAX_BYTES), _MAX_ELEMENTS, visit)
    except (OSError, ValueError):  # a file without a header that is damaged further on
        return ""
    return "".join(letter for letter in " ".join("".join(descriptions).split()) if letter.isprintable())


def resolve_scenario(name: str | os.PathLike[str]) -> Path:
    """Return the file of a scenario given by path or by library name; a path takes precedence.

    Raise SettingError with the most similar name if neither exists.
    """
    path = path_argument(name, "name", "the path or the library name of a scenario")
    if is_regular_file(path):
        _check_encoding(path)
        return path
    inside = _inside(path)
    if inside is not None:
        return inside
    if str(name) and os.path.isdir(path):
        raise SettingError(Diagnostic(f"{quoted(str(name))} is a folder", "give one .xosc file"))
    if str(name) and os.path.exists(path):
        return path  # a pipe or a device: the reader refuses it and states what it is
    hint = scenario_suggestion(name)
    raise SettingError(Diagnostic(f"no scenario {quoted(str(name))}: neither a file nor in the library", hint))


def scenario_suggestion(name: str | os.PathLike[str]) -> str:
    """Return a hint for a scenario that is neither a file nor in the library: a similar file beside it or name."""
    return file_suggestion(name, (SCENARIO_SUFFIX,), scenarios())


def from_library(name: str | os.PathLike[str]) -> Path:
    """Return the file of a library scenario; the path itself if it is a file or not a name of the library."""
    path = path_argument(name, "name", "the path or the library name of a scenario")
    return path if is_regular_file(path) else _inside(path) or path


def _inside(path: Path) -> Path | None:
    if path.is_absolute() or not path.name or ".." in path.parts:
        return None
    inside = library_path() / path
    for candidate in (inside.with_name(inside.name + SCENARIO_SUFFIX), inside):
        if is_regular_file(candidate) and candidate.suffix == SCENARIO_SUFFIX:
            return candidate
    return None


def resolve_path(path: str, folder: Path) -> Path:
    """Return the location of a path that a file in `folder` specifies; a backslash separates folders like a slash.

    A path that begins with `eidrive_library/` is resolved in a copy of the library in that folder; without a copy, in
    the library itself, never outside of it. Any other path is relative to the folder.
    """
    named = Path(path.strip().replace("\\", "/"))
    beside = folder / named
    if named.parts[:1] != (LIBRARY_FOLDER,) or ".." in named.parts or os.path.lexists(beside):
        return beside
    inside = library_path().joinpath(*named.parts[1:])
    return inside if os.path.exists(inside) else beside


def name_of(path: Path) -> str:
    """Return the library name of a scenario file, such as `coop/scenario_1`; the stem of any other file."""
    try:
        return absolute(path).relative_to(absolute(library_path())).with_suffix("").as_posix()
    except ValueError:
        return path.stem


def names(kind: Kind) -> list[str]:
    """Return the sorted names of the channel profiles or weather presets in the library."""
    return sorted(path.stem for path in (library_path() / kind).glob("*.yaml"))


def resolve(kind: Kind, name: str | os.PathLike[str]) -> Path:
    """Return the file of a channel profile or weather preset given by path or name.

    Raise SettingError with the most similar name if neither exists.
    """
    path = Path(name)
    if is_regular_file(path):
        return path
    inside = library_path() / kind / f"{name}.yaml"
    if is_regular_file(inside):
        return inside
    singular = "channel profile" if kind == "channels" else "weather preset"
    hint = file_suggestion(name, (".yaml", ".yml"), names(kind))
    raise SettingError(Diagnostic(f"no {singular} {quoted(str(name))}: neither a file nor in the library", hint))


def _check_encoding(path: Path) -> None:
    """Raise SettingError for a path that is not valid text: neither XML nor JSON could contain it."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        shown = os.fsencode(path).decode(errors="backslashreplace")
        hint = "rename it, or set a locale with UTF-8, such as LANG=C.UTF-8"
        raise SettingError(
            Diagnostic("the name has bytes that are not valid in the encoding of the locale", hint, shown)
        ) from None


def definition(path: Path) -> Definition:
    """Return the definition of an OpenSCENARIO file by its first elements, read without entities and network.

    `roads` is OpenDRIVE, `other` any other XML; `unreadable` is a file that is not XML up to the deciding element.
    """
    kinds: dict[str, Definition] = {
        "Catalog": "catalog",
        "ParameterValueDistribution": "distribution",
        "RoadNetwork": "scenario",
        "Entities": "scenario",
        "Storyboard": "scenario",
    }
    definitions: list[Definition] = []

    def visit(depth: int, tag: str, _: Mapping[str, str]) -> bool:
        if depth == 1 and tag != "OpenSCENARIO":
            definitions.append("roads" if tag == "OpenDRIVE" else "other")
        elif depth == 2 and tag in kinds:
            definitions.append(kinds[tag])
        return bool(definitions)

    try:
        content = read_regular_file(path_argument(path, "path"), _MAX_BYTES)
        return definitions[0] if first_elements(content, _MAX_ELEMENTS, visit) else "scenario"
    except (OSError, ValueError):
        return "unreadable"
