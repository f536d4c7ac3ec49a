"""Names of the library and files."""

import os
from pathlib import Path

import pytest

from eidrive_scenario.errors import ScenarioError, SettingError
from eidrive_scenario.extensions import library
from eidrive_scenario.openscenario import load_scenario

OPENING = '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3"/>'


@pytest.fixture
def own_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    root = tmp_path / "library"
    for name in ("coop/scenario_1.xosc", "coop/scenario_2.xosc", "catalogs/vehicles.xosc"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        kind = "Catalog" if "catalogs" in name else "Storyboard"
        (root / name).write_text(f"{OPENING}<{kind}/></OpenSCENARIO>")
    (root / "channels").mkdir()
    (root / "channels" / "latency_300ms.yaml").write_text("{}")
    monkeypatch.setattr(library, "library_path", lambda: root)
    return root


def test_scenarios_without_catalogs(own_library: Path) -> None:
    assert library.scenarios() == ["coop/scenario_1", "coop/scenario_2"]


def test_scenarios_are_described_by_their_header(own_library: Path) -> None:
    header = '<FileHeader revMajor="1" revMinor="3" description="two\n  lines &amp; a bell&#9;"/>'
    (own_library / "mine.xosc").write_text(f"<OpenSCENARIO>{header}<Storyboard/></OpenSCENARIO>")
    (own_library / "coop" / "scenario_2.xosc").write_text("<OpenSCENARIO><Storyboard/><damaged></OpenSCENARIO>")
    assert library.describe_scenarios() == [
        library.LibraryScenario("coop/scenario_1", "coop", ""),
        library.LibraryScenario("coop/scenario_2", "coop", ""),
        library.LibraryScenario("mine", "", "two lines & a bell"),
    ]


def test_every_scenario_of_this_checkout_has_a_family_and_a_description() -> None:
    entries = library.describe_scenarios()
    assert len(entries) >= 20
    assert all(entry.family == entry.name.split("/")[0] and entry.description for entry in entries)


@pytest.mark.parametrize("name", ["coop/scenario_1", "coop/scenario_1.xosc"])
def test_a_name_is_a_file_of_the_library(own_library: Path, name: str) -> None:
    assert library.resolve_scenario(name) == own_library / "coop" / "scenario_1.xosc"


def test_a_file_wins(own_library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    own = tmp_path / "coop" / "scenario_1.xosc"
    own.parent.mkdir()
    own.write_text("")
    assert library.resolve_scenario("coop/scenario_1.xosc").resolve() == own
    assert library.resolve_scenario(own) == own


def test_the_nearest_name_is_offered(own_library: Path) -> None:
    with pytest.raises(SettingError, match=r"no scenario 'coop/scenari_1'.*did you mean 'coop/scenario_1'\?"):
        library.resolve_scenario("coop/scenari_1")
    with pytest.raises(SettingError, match=r"no channel profile 'latency_300'.*did you mean 'latency_300ms'\?"):
        library.resolve("channels", "latency_300")
    with pytest.raises(SettingError, match="is a folder"):
        library.resolve_scenario(own_library)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_pipe_as_scenario_is_refused_as_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.xosc"
    os.mkfifo(pipe)
    with pytest.raises(ScenarioError, match=r"pipe\.xosc: cannot read: the path leads to a pipe"):
        load_scenario(library.resolve_scenario(pipe))


def test_profiles(own_library: Path) -> None:
    assert library.names("channels") == ["latency_300ms"]
    assert library.names("weather") == []
    assert library.resolve("channels", "latency_300ms") == own_library / "channels" / "latency_300ms.yaml"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (f"{OPENING}<ParameterDeclarations/><CatalogLocations/><RoadNetwork/>", "scenario"),
        (f"{OPENING}<Catalog name='c'/></OpenSCENARIO>", "catalog"),
        (f"{OPENING}<ParameterValueDistribution/></OpenSCENARIO>", "distribution"),
        ("<OpenDRIVE/>", "roads"),
        ("<OpenSCENARIO><FileHeader>", "unreadable"),
        ("no XML", "unreadable"),
        (f'<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/hostname">]>{OPENING}<Storyboard>&e;</Storyboard>', "scenario"),
    ],
)
def test_what_a_file_defines(tmp_path: Path, text: str, kind: str) -> None:
    path = tmp_path / "file.xosc"
    path.write_text(text)
    assert library.definition(path) == kind


def test_the_library_of_this_checkout_is_found() -> None:
    assert (library.library_path() / "coop").is_dir()


@pytest.mark.parametrize("name", ["", "x" * 300, "a\0b"])
def test_a_text_that_is_no_path_is_no_file(own_library: Path, name: str) -> None:
    with pytest.raises(SettingError, match="neither a file nor in the library"):
        library.resolve_scenario(name)
    with pytest.raises(SettingError, match="neither a file nor in the library"):
        library.resolve("weather", name)
