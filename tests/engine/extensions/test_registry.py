"""Extensions by name, and the errors of invalid ones."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from eidrive_scenario.errors import RegistryError, SettingError
from eidrive_scenario.extensions.registry import Registry

GROUP = "eidrive_scenario.criteria"


def registry_of(**values: str) -> Registry:
    return Registry("criteria", [EntryPoint(name, value, GROUP) for name, value in values.items()])


def test_extension_is_imported_on_load() -> None:
    known = registry_of(collision="eidrive_criteria.collision:Collision", broken="no.such.module:Thing")
    assert list(known) == ["broken", "collision"]
    assert known.load("collision").name == "collision"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("no.such.module:Thing", r"\(no\.such\.module:Thing\) does not load: No module named 'no'"),
        ("eidrive_criteria.collision:Colision", "does not load: .* has no attribute 'Colision'"),
        ("eidrive_scenario.evaluation.criterion:Criterion", "lacks observe, verdict"),
    ],
)
def test_invalid_extension_is_reported_by_name(value: str, message: str) -> None:
    with pytest.raises(RegistryError, match=f"^criterion 'mine' .*{message}"):
        registry_of(mine=value).load("mine")


def test_duplicate_name_raises_with_both_modules() -> None:
    points = [EntryPoint("mine", value, GROUP) for value in ("one:Thing", "two:Thing")]
    with pytest.raises(RegistryError, match=r"^criterion 'mine' is registered twice: one:Thing and two:Thing"):
        Registry("criteria", points)
    assert list(Registry("criteria", points[:1] * 2)) == ["mine"], "one package found twice is no clash"


def test_unknown_name_suggests_the_nearest() -> None:
    with pytest.raises(SettingError, match=r"^unknown criterion 'colision'; did you mean 'collision'\?"):
        registry_of(collision="eidrive_criteria.collision:Collision").load("colision")


@pytest.mark.parametrize(("kind", "noun"), [("fusion", "fusion method"), ("vehicle_controllers", "vehicle controller")])
def test_errors_use_the_noun_of_the_kind(kind: str, noun: str) -> None:
    point = EntryPoint("mine", "no.such.module:Thing", f"eidrive_scenario.{kind}")
    with pytest.raises(SettingError, match=f"^unknown {noun} 'other'"):
        Registry(kind, [point]).load("other")
    with pytest.raises(RegistryError, match=f"^{noun} 'mine' .* does not load"):
        Registry(kind, [point]).load("mine")


def test_distribution_names_the_package_of_third_parties_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    metadata = tmp_path / "radar_kit-1.4.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: radar-kit\nVersion: 1.4\n")
    (metadata / "entry_points.txt").write_text("[eidrive_scenario.detectors]\nradar = radar_kit:Radar\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    detectors = Registry("detectors")
    assert detectors.distribution("radar") == "radar-kit 1.4 (radar_kit:Radar)"
    assert detectors.distribution("oracle") is None
    assert detectors.distribution("no such") is None
    detectors.add("sonar", "own_project:Sonar")
    assert detectors.distribution("sonar") == "own_project:Sonar"
