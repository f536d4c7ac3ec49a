"""Markers of tests that run scenarios: `scenario`, the folder of the file, and `slow`."""

from __future__ import annotations

import hashlib
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path

import pytest

_SCENARIO = (
    "scenario(pattern, channel=None, seeds=None, success_rate=None, drive=None, criteria=None): run the test once for "
    "every scenario that matches the pattern (beside the test file, below the root, or in the library), channel and "
    "seed, through the fixture run_scenario; success_rate: run seeds until a sequential test decides; drive and "
    "criteria are those of RunSettings. Each run has a marker scenario(name=…, channel=…, seed=…) for the option -m"
)
_SLOW = "slow: run of a scenario in eidrive_slow, or a test of a success rate, which has many runs"
_INI_SLOW = "eidrive_slow"
_RESERVED = frozenset(
    {
        *("skip", "skipif", "xfail", "parametrize", "usefixtures", "filterwarnings", "tryfirst", "trylast", "scenario"),
        *("anyio", "asyncio", "benchmark", "dependency", "flaky", "no_cover", "order", "repeat", "timeout"),
        "xdist_group",
    }
)
"""Markers with an effect, which a folder of their name must not set."""
_DECLARED = pytest.StashKey[set[str]]()


def add_ini_option(parser: pytest.Parser) -> None:
    """Add the ini option of slow scenarios."""
    parser.addini(
        _INI_SLOW,
        "patterns of scenario files below the root with the marker slow, such as xosc/ei/*, one per line",
        type="linelist",
        default=[],
    )


def declare(config: pytest.Config) -> None:
    """Declare the markers `scenario` and `slow`; those of folders follow with their first file."""
    config.addinivalue_line("markers", _SCENARIO)
    config.addinivalue_line("markers", _SLOW)
    config.stash[_DECLARED] = {"scenario", "slow"}


def family_of(path: Path) -> str:
    """Return the marker of the folder of a file, or "" for a folder that sets none."""
    name = re.sub(r"\W+", "_", path.parent.name).strip("_")
    return "" if name in _RESERVED else name


def test_name(config: pytest.Config, path: Path, *, all_folders: bool) -> str:
    """Return the part of a test name that a scenario file has, such as `coop/scenario_1`.

    The name has the folder of the file, or all folders, without the root, whose name differs between checkouts.
    """
    below = _below_root(config, path)
    folders = below.parent.parts if all_folders else below.parent.parts[-1:]
    return "/".join(re.sub(r"[^\w.+=,~-]+", "_", part) for part in (*folders, path.stem))


def distinct_test_names(config: pytest.Config, paths: Iterable[Path]) -> dict[Path, str]:
    """Return the parts of the names of one test that its scenario files have.

    Files of equal names have all folders, and if they differ in replaced characters only, a hash of their paths.
    """

    def hashed(path: Path) -> str:
        digest = hashlib.sha256(os.fsencode(_below_root(config, path).as_posix())).hexdigest()
        return f"{test_name(config, path, all_folders=True)}-{digest[:8]}"

    names = {path: test_name(config, path, all_folders=False) for path in paths}
    for longer in (partial(test_name, config, all_folders=True), hashed):
        count = Counter(names.values())
        names = {path: longer(path) if count[name] > 1 else name for path, name in names.items()}
    return names


def _below_root(config: pytest.Config, path: Path) -> Path:
    return path.relative_to(config.rootpath) if path.is_relative_to(config.rootpath) else path


def run_markers(
    config: pytest.Config, path: Path, selectors: Mapping[str, str | int], run: int | None
) -> Iterator[pytest.MarkDecorator]:
    """Yield the markers of one run of a scenario file, or of one run of a distribution.

    selectors  settings of the run by name
    """
    settings = {} if run is None else {"run": run}
    yield pytest.mark.scenario(name=path.stem, folder=path.parent.name, **settings, **selectors)
    family = family_of(path)
    if family:
        yield _marker(config, family, f"scenarios in folders named {path.parent.name}")
    file = _below_root(config, path)
    is_slow = "rate" in selectors or any(fnmatchcase(file.as_posix(), pattern) for pattern in config.getini(_INI_SLOW))
    if is_slow and family != "slow":
        yield pytest.mark.slow


def keywords(selectors: Mapping[str, str | int], run: int | None) -> set[str]:
    """Return words for the option -k, whose expressions cannot contain an equals sign: `channel:ideal`, `seed:3`."""
    words = {f"{name}:{value}" for name, value in selectors.items()}
    return words if run is None else {*words, f"run:{run}"}


def _marker(config: pytest.Config, name: str, description: str) -> pytest.MarkDecorator:
    """Return a marker, declared for the option --strict-markers."""
    declared = config.stash[_DECLARED]
    if name not in declared:
        declared.add(name)
        config.addinivalue_line("markers", f"{name}: {description}")
    return getattr(pytest.mark, name)  # type: ignore[no-any-return]
