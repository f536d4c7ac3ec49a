"""Digest of everything that determines the outcome of a job except its seed: settings, scenario, library and code."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from eidrive_scenario.experiments import average_precision, cooperative_perception
from eidrive_scenario.experiments.cooperative_perception.conditions import Condition
from eidrive_scenario.experiments.reproduction import channel_load, episodes
from eidrive_scenario.library import library_path, resolve_scenario
from eidrive_scenario.resolved_settings import canonical_json, sha256_of
from eidrive_scenario.simulation import RunSettings

PACKAGES = ("eidrive_scenario", "eidrive_behaviors", "eidrive_criteria")
"""Packages of this project whose code a run executes."""
NOT_EXECUTED = frozenset({"__pycache__", "checks", "cli", "experiments", "library", "pytest_plugin", "reporting"})
"""Subpackages of the engine that a run does not use, and the library, of which only the used folders count."""
LIBRARY_FOLDERS = ("catalogs", "channels", "roads")
"""Folders of the library that the scenarios refer to."""
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
    if conditions:
        content |= {"conditions": [one.name for one in conditions], "measurement": _measurement_digest()}
    return sha256_of(canonical_json(content).encode())[:_LENGTH]


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
    paths = [Path(average_precision.__file__), *sorted(folder.glob("*.py"))]
    return sha256_of(b"".join(path.read_bytes() for path in paths))[:_LENGTH]


@cache
def _scenario_digest(scenario: str) -> str:
    return sha256_of(resolve_scenario(scenario).read_bytes())


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
