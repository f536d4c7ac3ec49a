"""Packages whose names are imported on first access."""

from __future__ import annotations

import importlib

import pytest

import eidrive_scenario.traffic
from eidrive_scenario.base.imports import lazy_exports


@pytest.mark.parametrize(
    "package",
    ["openscenario", "traffic", "world"],
)
def test_package_with_lazy_exports_has_all_its_names(package: str) -> None:
    module = importlib.import_module(f"eidrive_scenario.{package}")
    assert [name for name in module.__all__ if not hasattr(module, name)] == []


def test_unknown_name_of_a_lazy_package_raises_attribute_error() -> None:
    assert not hasattr(eidrive_scenario.traffic, "Generator")
    with pytest.raises(ImportError, match="cannot import name 'Generator'"):
        exec("from eidrive_scenario.traffic import Generator")


def test_lazy_export_is_stored_in_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    package = eidrive_scenario.traffic
    monkeypatch.delitem(vars(package), "Sink", raising=False)
    value = lazy_exports(package.__name__, {"spawning.generators": "Sink Other"})("Sink")
    assert vars(package)["Sink"] is value
    assert value.__module__ == "eidrive_scenario.traffic.spawning.generators"
