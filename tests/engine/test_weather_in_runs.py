"""The weather of a run: by EnvironmentAction, from a catalog, by an option; and wrong sensors before it starts."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from scenario_1 import edited

from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.simulation.commands import execute
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.weather import load_weather

INIT = "<Init>\n         <Actions>"
RAIN = """<GlobalAction><EnvironmentAction><Environment name="Shower">
  <Weather fractionalCloudCover="sixOktas"><Sun azimuth="0" elevation="0.5" intensity="50000"/>
  <Fog visualRange="800"/><Precipitation precipitationType="rain" precipitationIntensity="12"/></Weather>
  <RoadCondition frictionScaleFactor="0.6" wetness="wetWithPuddles"/></Environment></EnvironmentAction></GlobalAction>
"""
FROM_CATALOG = """<GlobalAction><EnvironmentAction>
  <CatalogReference catalogName="environments" entryName="storm"/></EnvironmentAction></GlobalAction>
"""


def test_environment_action_sets_light_fog_and_friction(tmp_path: Path) -> None:
    with Simulation(load_scenario(edited(tmp_path, (INIT, INIT + RAIN)))) as run:
        weather = run.world.weather
        assert (weather.name, weather.cloud_cover, weather.visual_range) == ("Shower", 0.75, 800.0)
        assert (weather.precipitation, weather.precipitation_intensity, weather.wetness) == ("rain", 12.0, 0.5)
        assert run.world._friction == weather.friction_scale == 0.6


@pytest.mark.parametrize("animation", [True, False])
def test_sun_follows_a_running_clock(tmp_path: Path, animation: bool) -> None:
    """At an equinox the sun is 48° from the zenith at noon and sets at 18 h, sinking 15° cos 48° per hour."""
    clock = f"""<GlobalAction><EnvironmentAction><Environment name="Dusk">
      <TimeOfDay animation="{str(animation).lower()}" dateTime="2026-03-22T17:58:00"/></Environment>
      </EnvironmentAction></GlobalAction>"""
    with Simulation(load_scenario(edited(tmp_path, (INIT, INIT + clock)))) as run:
        before = run.world.weather.sun_elevation
        run.world.tick += round(120.0 / run.world.dt)
        execute(Commands(), run._state)
        sunk = before - run.world.weather.sun_elevation
    assert sunk == pytest.approx(2.0 / 60.0 * 15.0 * math.cos(math.radians(48.0)) if animation else 0.0, abs=0.01)


def test_clock_stops_at_the_end_of_the_calendar() -> None:
    last = Environment(date_time="9999-12-31T23:59:59+00:00", clock_runs=True)
    assert [last.clock(time).isoformat()[:19] for time in (0.5, 2.0)] == ["9999-12-31T23:59:59"] * 2  # type: ignore[union-attr]


def test_environment_of_catalog_is_applied(tmp_path: Path) -> None:
    place = '<EnvironmentCatalog><Directory path="../catalogs"/></EnvironmentCatalog>'
    after = "<MiscObjectCatalog>"
    path = edited(tmp_path, (INIT, INIT + FROM_CATALOG), (after, place + after))
    with Simulation(load_scenario(path)) as run:
        storm, preset = run.world.weather, load_weather("storm")
        assert storm.precipitation_intensity == preset.precipitation_intensity
        assert storm.visual_range == preset.visual_range
        assert storm.sun_elevation == pytest.approx(preset.sun_elevation, abs=0.1)
        assert storm.friction_scale == pytest.approx(preset.friction_scale, abs=0.01)


def test_weather_option_overrides_the_file(tmp_path: Path) -> None:
    path = edited(tmp_path, (INIT, INIT + RAIN))
    with Simulation(load_scenario(path), settings=RunSettings(weather="midnight")) as run:
        run.tick()
        assert run.world.weather == load_weather("midnight")


def test_unknown_preset_is_reported_with_other_diagnostics_before_run(tmp_path: Path) -> None:
    wrong = tmp_path / "mine.yaml"
    wrong.write_text("name: mine\nfog: 40\n")
    scenario = load_scenario(resolve_scenario("coop/scenario_1"))
    with pytest.raises(InputError, match=r"RunSettings.weather: no weather preset 'hail'"):
        Simulation(scenario, settings=RunSettings(weather="hail"))
    with pytest.raises(InputError, match=r"mine\.yaml:2: unknown setting 'fog'"):
        Simulation(scenario, settings=RunSettings(weather=wrong))


@pytest.mark.parametrize(
    ("sensors", "complaint"),
    [
        ("{front: {kind: camera, width: 0}}", "width"),
        ("{front: {kind: camera, fov: 100, distortion: [-0.9]}}", "folds the image"),
        ("{front: {kind: camera, widht: 800}}", "did you mean 'width'"),
        ("{truth: {}, roof: {kind: lidar, channels: 16, elevations: [1, 2]}}", "elevations has the wrong length"),
        ("{truth: {}, sky: {kind: gps}}", "gnss"),
    ],
)
def test_invalid_sensors_are_reported_with_file_and_line(tmp_path: Path, sensors: str, complaint: str) -> None:
    line = '<Property name="detector" value="oracle"/>'
    path = edited(tmp_path, (line, f'{line}\n<Property name="sensors" value="{sensors}"/>'))
    number = path.read_text().split("\n").index(f'<Property name="sensors" value="{sensors}"/>') + 1
    with pytest.raises(InputError) as caught:
        Simulation(load_scenario(path))
    assert f"edited.xosc:{number}: " in str(caught.value)
    assert complaint in str(caught.value)
