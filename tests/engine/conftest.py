"""Shared fixtures of the engine tests."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from faulty_extensions import BROKEN_MODULES, install

from eidrive_scenario.extensions import registry


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Install the package of faulty extensions and return its folder."""
    folder = install(tmp_path_factory.mktemp("faulty"))
    registry._registries.clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield folder
    registry._registries.clear()
    for name in ("faulty", *BROKEN_MODULES):
        sys.modules.pop(name, None)
