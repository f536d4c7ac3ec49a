"""Origin of the results of a part: commit, versions, seeds and durations, which differ between equal results."""

from __future__ import annotations

import hashlib
import json
import platform
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from inspect import getfile
from pathlib import Path
from typing import Any

from eidrive_reports import cooperative_perception
from eidrive_reports.cooperative_perception.receivers import Condition
from eidrive_reports.reproduction import channel_load, episodes
from eidrive_scenario.api.common import Diagnostic, InputError, SettingError, load_json, registry, write_atomically
from eidrive_scenario.api.experiments import (
    average_precision,
    canonical_json,
    library_path,
    resolve_scenario,
    sha256_of,
)
from eidrive_scenario.api.run import RunSettings, Simulation, load_scenario

PACKAGES = ("eidrive_scenario", "eidrive_behaviors", "eidrive_criteria")
"""Packages of this project whose code a run executes."""
NOT_EXECUTED = frozenset({"__pycache__", "checks", "cli", "experiments", "library", "pytest_plugin", "reporting"})
"""Subpackages of the engine that a run does not use, and the library, of which only the used folders count."""
LIBRARY_FOLDERS = ("catalogs", "channels", "roads")
"""Folders of the library that the scenarios refer to."""
ENGINE = "eidrive-scenario"
"""Name of the distribution."""
DEPENDENCIES = ("numpy", "onnxruntime", "openvino", "pybullet", "scipy", "torch")
"""Packages of others that affect the result."""
_LENGTH = 16
"""Number of hexadecimal digits of a digest."""


def job_digest(scenario: str, settings: RunSettings, *, load: int = 0, conditions: Sequence[Condition] = ()) -> str:
    """Return the digest of a job: equal digests and seeds give equal outcomes.

    load        number of stations that are added to the scenario
    conditions  conditions under which the perception of the ego is measured
    """
    given = {name: str(value) for name, value in asdict(settings).items()}
    content = {"code": code_digest(), "scenario": _scenario_digest(scenario), "settings": given, "load": load}
    own = [*_own_files(settings), *_named_modules(scenario)]
    if own:
        content["files"] = [sha256_of(path.read_bytes()) for path in own]
    if conditions:
        content |= {"conditions": [condition.name for condition in conditions], "measurement": _measurement_digest()}
    return sha256_of(canonical_json(content).encode())[:_LENGTH]


def _own_files(settings: RunSettings) -> list[Path]:
    """Return the modules of extensions of others, and the files, that settings name.

    Raise SettingError or RegistryError if an extension does not load.
    """
    named = (("detectors", settings.detector), ("fusion", settings.fusion), ("planners", settings.planner))
    used = [(registry(kind), name) for kind, name in named if name is not None]
    modules = [Path(getfile(group.load(name))) for group, name in used if group.distribution(name) is not None]
    return modules + [path for path in map(Path, map(str, settings.sources)) if _is_file(path)]


@cache
def _named_modules(scenario: str) -> tuple[Path, ...]:
    """Return the modules of extensions of others that a scenario names; those of the library name none."""
    path = resolve_scenario(scenario)
    if path.is_relative_to(library_path()):
        return ()
    try:
        with Simulation(path, load_weights=False) as simulation:
            names = [name.partition(".") for name in simulation.resolved.extensions]
    except InputError:  # the settings of a job may give what the scenario lacks
        return ()
    return tuple(Path(getfile(registry(kind).load(name))) for kind, _, name in names)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # the text of a profile is longer than a name may be
        return False


@cache
def code_digest() -> str:
    """Return the digest of the code and data of the engine and its extensions, and of the versions of dependencies."""
    digest = hashlib.sha256()
    for root, path in _code_files():
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    for name in DEPENDENCIES:
        digest.update(f"{name} {_version(name)}".encode())
    return digest.hexdigest()[:_LENGTH]


def _code_files() -> Iterator[tuple[Path, Path]]:
    """Yield root and path of each file, sorted by root and path."""
    for package in PACKAGES:
        spec = find_spec(package)
        for location in sorted((spec.submodule_search_locations or ()) if spec else ()):
            root = Path(location)
            for path in sorted(root.rglob("*")):
                if path.is_file() and not NOT_EXECUTED.intersection(path.relative_to(root).parts):
                    yield root, path
    for file in (channel_load.__file__, episodes.__file__):
        yield Path(file).parent, Path(file)
    for folder in LIBRARY_FOLDERS:
        for path in sorted((library_path() / folder).rglob("*")):
            if path.is_file():
                yield library_path(), path


@cache
def _measurement_digest() -> str:
    """Return the digest of the code that measures perception, which runs of other parts do not execute."""
    folder = Path(cooperative_perception.__file__).parent
    paths = [Path(getfile(average_precision)), *sorted(folder.glob("*.py"))]
    return sha256_of(b"".join(path.read_bytes() for path in paths))[:_LENGTH]


@cache
def _scenario_digest(scenario: str) -> str:
    """Return the digest of a scenario, its road file and its catalogs, which need not be in the library."""
    path = resolve_scenario(scenario)
    loaded = load_scenario(path)
    road = "" if loaded.road_file is None else sha256_of(loaded.road_file.read_bytes())
    return sha256_of(canonical_json([sha256_of(path.read_bytes()), road, *loaded.catalogs.values()]).encode())


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"


FILE = "provenance.json"
"""Name of the file in the folder of the results."""


def read_provenance(out: Path) -> dict[str, Any]:
    """Return the origins of the parts in a folder by their names; empty without a file.

    Raise SettingError if the file is damaged.
    """
    path = out / FILE
    if not path.is_file():
        return {}
    try:
        origins = load_json(path.read_bytes())
    except ValueError as error:
        raise SettingError(Diagnostic(f"the file is damaged: {error}", "remove it", str(path))) from error
    if not isinstance(origins, dict) or not all(isinstance(origin, dict) for origin in origins.values()):
        raise SettingError(Diagnostic("the file is damaged: not a JSON object", "remove it", str(path)))
    return origins


def write_provenance(
    out: Path,
    part: str,
    values: Mapping[str, Any],
    *,
    checkout: str | None,
    added: int,
    elapsed_s: float,
    processes: int,
) -> None:
    """Add the origin of a part to the file of a folder, which keeps those of other parts.

    values     further values of the part, such as seeds
    checkout   `commit` before the call
    added      number of runs of this call; without one, commit and duration remain those of the call that computed
    elapsed_s  duration of this call [s];  processes  number of its processes
    """
    origins = read_provenance(out)
    code = {"version": version(ENGINE), "code": code_digest(), "python": platform.python_version()}
    call = {
        "commit": checkout,
        "runs_of_last_call": added,
        "last_call_s": round(elapsed_s, 1),
        "processes": processes,
    }
    former = origins.get(part, {})
    if not added and former.get("code") == code["code"]:
        call = {name: former.get(name) for name in call}
    parts = {**origins, part: {**code, **call, **values}}
    with write_atomically(out / FILE) as stream:
        stream.write((json.dumps(parts, indent=1, sort_keys=True) + "\n").encode())


@cache
def commit() -> str | None:
    """Return the commit of the checkout, followed by `+` if files differ from it; None outside of a checkout.

    The result is that of the first call: reports that parts write may be files of the checkout.
    """
    folder = library_path()
    try:
        if Path(_git(folder, "rev-parse", "--show-toplevel")) != folder.resolve().parent:
            return None  # an installed package within the checkout of another project
        head = _git(folder, "rev-parse", "HEAD")
        return head + ("+" if _git(folder, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(folder: Path, *arguments: str) -> str:
    return subprocess.run(
        ["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=True, timeout=30
    ).stdout.strip()
