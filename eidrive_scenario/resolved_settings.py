"""Settings of a run after options, scenario and random draws are combined, with their JSON form and hash."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ENGINE = "eidrive-scenario"
_PACKAGES = (ENGINE, "numpy", "pybullet")
_FILE_KEYS = frozenset({"file", "weights", "asn1_files"})
"""Settings that name a file, in a channel profile, controller properties or a weather preset."""
_SHORT = 10


@dataclass(frozen=True)
class ResolvedSettings:
    """All settings that determine the result of one run.

    scenario         name in the library, or of the file
    seed             seed of all random numbers
    run              number of the run in a parameter value distribution
    channel          name of the initial profile; `custom` for one without a name, `none` for no cooperation
    channel_profile  its content with all defaults; None for no cooperation
    later_channels   profiles that events of the scenario select, in the order of the file
    detector, planner, cooperate   the options that override the scenario; None if the scenario applies
    stations         settings of each station, by name: detector, its settings, cooperation, sensors and all others
    weather          name of the preset that overrides the scenario; None if the scenario applies
    weather_profile  its content
    parameters       parameters of the scenario, with their final values
    drawn            names of the parameters whose values this seed has drawn
    varied           names of the parameters that a parameter value distribution assigns
    controllers      controller models, by name of the controller
    user_values      values of UserDefinedValueConditions, by name
    drive            entities that an option gives a driving stack, sorted; its settings are in `stations`
    criteria         criteria that an option adds, each a mapping of its name to its settings
    dt, time_limit   time step and maximum simulated time [s]
    files            role, name and SHA-256 of each input file; the scenario is the first
    versions         versions of the packages that affect the result
    extensions       package, version and entry point of each third-party extension, by kind and name
    """

    scenario: str = ""
    seed: int = 0
    run: int | None = None
    channel: str = "none"
    channel_profile: Mapping[str, Any] | None = None
    later_channels: tuple[Mapping[str, Any] | None, ...] = ()
    detector: str | None = None
    planner: str | None = None
    cooperate: tuple[str, ...] | None = None
    stations: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    weather: str | None = None
    weather_profile: Mapping[str, Any] | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    drawn: tuple[str, ...] = ()
    varied: tuple[str, ...] = ()
    controllers: Mapping[str, str] = field(default_factory=dict)
    user_values: Mapping[str, str] = field(default_factory=dict)
    drive: tuple[str, ...] = ()
    criteria: tuple[Mapping[str, Any], ...] = ()
    dt: float = 0.05
    time_limit: float = 120.0
    files: tuple[tuple[str, str, str], ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    extensions: Mapping[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the settings as JSON values, in the order of the fields."""
        found: dict[str, Any] = {entry.name: _plain(getattr(self, entry.name)) for entry in fields(self)}
        found["files"] = [{"role": role, "name": name, "sha256": digest} for role, name, digest in self.files]
        return found

    @property
    def canonical(self) -> str:
        """Return the JSON form that is hashed: sorted keys, no white space, ASCII."""
        return canonical_json(self.as_json())

    @cached_property
    def digest(self) -> str:
        """Return the SHA-256 of the canonical form, 64 hexadecimal digits."""
        return sha256_of(self.canonical.encode())

    @property
    def short_digest(self) -> str:
        """Return the first digits of the digest, which distinguish the folders of runs."""
        return self.digest[:_SHORT]

    def of_distribution(self, run: int | None, varied: Iterable[str]) -> ResolvedSettings:
        """Return these settings with the number and the assigned parameters of a run of a distribution."""
        return replace(self, run=run, varied=tuple(sorted(varied)))


def canonical_json(value: Any) -> str:
    """Return JSON with sorted keys, without white space, in ASCII: equal values give equal texts."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def sha256_of(content: bytes) -> str:
    """Return the SHA-256 as 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


@cache
def package_versions() -> Mapping[str, str]:
    """Return the installed versions of the packages that affect the result."""
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def without_folders(value: Any) -> Any:
    """Return settings with file names without folders, so that equal settings are equal on any machine."""
    if isinstance(value, Mapping):
        return {key: _names_only(item) if key in _FILE_KEYS else without_folders(item) for key, item in value.items()}
    return [without_folders(item) for item in value] if isinstance(value, list | tuple) else value


def named_files(value: Any) -> Iterator[str]:
    """Yield the file names in settings, as written there."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            if key in _FILE_KEYS:
                yield from (str(name) for name in (item if isinstance(item, list | tuple) else [item]) if name)
            else:
                yield from named_files(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from named_files(item)


def _names_only(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_names_only(item) for item in value]
    return Path(value).name if isinstance(value, str | Path) else without_folders(value)


def _plain(value: Any) -> Any:
    """Return a value of JSON types; numbers that JSON lacks and all other types become texts."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, frozenset | set):
        return sorted((_plain(item) for item in value), key=str)
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if value is None or isinstance(value, bool | int | str) else str(value)
