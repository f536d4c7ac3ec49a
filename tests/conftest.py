"""Markers and crashes of all tests.

Pytest sessions within tests redirect the stacks of faulthandler to files that no longer exist.
"""

from __future__ import annotations

import faulthandler
import gc
import os
from collections.abc import Iterator

import pytest

_ERROR_OUTPUT = pytest.StashKey[int]()


def pytest_configure(config: pytest.Config) -> None:
    """Keep the error output of the session, before the output of tests is captured."""
    config.stash[_ERROR_OUTPUT] = os.dup(2)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Write the stack of a crash to the error output of the session again."""
    if item.config.pluginmanager.has_plugin("faulthandler"):
        faulthandler.enable(file=item.config.stash[_ERROR_OUTPUT])


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect no garbage while the modules of the tests are loaded, and never look for it among them."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that start pytest sessions."""
    for item in items:
        if "pytester" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.process)
