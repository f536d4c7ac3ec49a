"""All settings that make a run, after the options, the scenario and its draws are combined: one type, one JSON form,
one hash."""

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
"""Settings that name a file, in a channel profile, a controller's properties or a weather."""
_SHORT = 10


@dataclass(frozen=True)
class ResolvedSettings:
    """All settings that determine the result of one run.

    scenario         name in the library, or of the file
    seed             of all randomness
    run              number among the runs of a parameter value distribution
    channel          name of the profile at the start, `custom` for one without a name, `none` for no cooperation
    channel_profile  its content with all defaults; None for no cooperation
    later_channels   profiles that events of the scenario select, in the order of the file
    detector, cooperate   the options that override the scenario; None where it decides
    stations         settings of each station, by name: detector, its settings, cooperation, sensors and all others
    weather          name of the preset that overrides the scenario; None where it decides
    weather_profile  its content
    parameters       of the scenario as a whole, with the values that count
    drawn            names of the parameters that this seed has drawn
    varied           names of the parameters that a parameter value distribution assigns
    controllers      controller models, by the controller's name
    user_values      for UserDefinedValueConditions, by name
    dt, time_limit   [s]
    files            SHA-256 of each file that enters: (role, name, digest); the scenario is the first
    versions         of the packages that decide the result
    extensions       of third parties that are used, by kind and name: package, version and entry point
    """

    scenario: str = ""
    seed: int = 0
    run: int | None = None
    channel: str = "none"
    channel_profile: Mapping[str, Any] | None = None
    later_channels: tuple[Mapping[str, Any] | None, ...] = ()
    detector: str | None = None
    cooperate: tuple[str, ...] | None = None
    stations: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    weather: str | None = None
    weather_profile: Mapping[str, Any] | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    drawn: tuple[str, ...] = ()
    varied: tuple[str, ...] = ()
    controllers: Mapping[str, str] = field(default_factory=dict)
    user_values: Mapping[str, str] = field(default_factory=dict)
    dt: float = 0.05
    time_limit: float = 120.0
    files: tuple[tuple[str, str, str], ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    extensions: Mapping[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The settings as JSON values, in the order of the fields."""
        found: dict[str, Any] = {entry.name: _plain(getattr(self, entry.name)) for entry in fields(self)}
        found["files"] = [{"role": role, "name": name, "sha256": digest} for role, name, digest in self.files]
        return found

    @property
    def canonical(self) -> str:
        """The JSON form that is hashed: sorted keys, no white space, ASCII."""
        return canonical_json(self.as_json())

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the canonical form, 64 hexadecimal digits."""
        return hashlib.sha256(self.canonical.encode()).hexdigest()

    @property
    def short_digest(self) -> str:
        """The first digits of the digest, which tell the folders of runs apart."""
        return self.digest[:_SHORT]

    def of_distribution(self, run: int | None, varied: Iterable[str]) -> ResolvedSettings:
        """The same settings as those of a run of a parameter value distribution."""
        return replace(self, run=run, varied=tuple(sorted(varied)))


def canonical_json(value: Any) -> str:
    """JSON with sorted keys, without white space, in ASCII: equal values give equal texts."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def sha256_of(content: bytes) -> str:
    """SHA-256 as 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


@cache
def package_versions() -> Mapping[str, str]:
    """The installed versions of the packages that decide a result."""
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def without_folders(value: Any) -> Any:
    """Settings whose files are named without their folders, so that equal settings are equal on any machine."""
    if isinstance(value, Mapping):
        return {key: _names_only(item) if key in _FILE_KEYS else without_folders(item) for key, item in value.items()}
    return [without_folders(item) for item in value] if isinstance(value, list | tuple) else value


def named_files(value: Any) -> Iterator[str]:
    """The files that settings name, as they are written there."""
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
    """Values of JSON only; numbers that JSON does not have are spelled, anything else becomes a text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, frozenset | set):
        return sorted((_plain(item) for item in value), key=str)
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if value is None or isinstance(value, bool | int | str) else str(value)
