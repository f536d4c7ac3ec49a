"""Option `fusion` of a run: the fusion method of all stations, in place of their property."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

SCENARIO = library_path() / "coop" / "scenario_1.xosc"


def scenario_with(folder: Path, **properties: str) -> Path:
    """Write scenario 1 in which the property `fusion` of all stations is replaced by these properties."""
    text = SCENARIO.read_text(encoding="utf-8").replace('="../', f'="{library_path()}/')
    given = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in properties.items())
    assert '<Property name="fusion" value="average"/>' in text
    path = folder / "scenario.xosc"
    path.write_text(text.replace('<Property name="fusion" value="average"/>', given), encoding="utf-8")
    return path


def stations_of(path: Path, **options: Any) -> list[tuple[Any, Any]]:
    """Return method and settings of fusion of each station as they are after the options."""
    result = run_file(path, settings=RunSettings(time_limit=0.1, **options))
    return [(station["fusion"], station["fusion_settings"]) for station in result.settings.stations.values()]


def test_fusion_option_equals_property_of_all_stations(tmp_path: Path) -> None:
    edited = scenario_with(tmp_path, fusion="covariance_intersection")
    by_property = run_file(edited, settings=RunSettings(channel="latency_300ms", time_limit=4.0))
    by_option = run_file(
        SCENARIO, settings=RunSettings(channel="latency_300ms", time_limit=4.0, fusion="covariance_intersection")
    )
    default = run_file(SCENARIO, settings=RunSettings(channel="latency_300ms", time_limit=4.0))
    assert by_option.trace_hash == by_property.trace_hash != default.trace_hash
    assert by_option.settings.stations == by_property.settings.stations


def test_fusion_option_replaces_settings_of_another_method(tmp_path: Path) -> None:
    path = scenario_with(tmp_path, fusion="covariance_intersection", fusion_settings="{gate: 0.9}")
    assert all(settings["gate"] == 0.9 for _, settings in stations_of(path, fusion="covariance_intersection"))
    assert {method for method, _ in stations_of(path, fusion="average")} == {"average"}


def test_unknown_methods_and_detectors_of_options_are_reported_together() -> None:
    with pytest.raises(InputError) as caught:
        Simulation(SCENARIO, settings=RunSettings(fusion="averag", detector="orcale"))
    assert [str(diagnostic) for diagnostic in caught.value.diagnostics] == [
        "RunSettings.detector: unknown detector 'orcale'; did you mean 'oracle'?",
        "RunSettings.fusion: unknown fusion method 'averag'; did you mean 'average'?",
    ]


def test_unsuitable_method_of_option_names_option() -> None:
    with pytest.raises(InputError, match=r"^RunSettings.fusion: fusion method 'early' shares points"):
        Simulation(SCENARIO, settings=RunSettings(fusion="early"))


@pytest.mark.process
def test_fusion_is_an_axis_and_unlike_a_parameter_is_written_small(tmp_path: Path) -> None:
    store = tmp_path / "s.db"
    sweep = ["sweep", str(SCENARIO), "--store", str(store), "--time-limit", "0.1", "--workers", "1", "--vary"]
    done = CliRunner().invoke(app, [*sweep, "fusion=average,covariance_intersection"])
    assert done.exit_code == 0, done.output
    table = CliRunner().invoke(app, ["results", str(store), "--json"]).stdout
    assert '{"fusion": "average"}' in table
    assert '{"fusion": "covariance_intersection"}' in table
    done = CliRunner().invoke(app, [*sweep, "Fusion=average"])
    assert done.exit_code == 2
    assert "unknown parameter or setting 'Fusion'; did you mean 'fusion'?" in " ".join(done.stderr.split())
