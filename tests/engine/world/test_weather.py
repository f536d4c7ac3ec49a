"""Tests of weather: settings, presets, effects on air and road, and conversion of Environment."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.library import names
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control, Placement
from eidrive_scenario.world.environment import Environment, solar_position, weather_from_environment
from eidrive_scenario.world.weather import Weather, load_weather


def test_presets_have_weather_of_their_names() -> None:
    assert names("weather") == ["foggy_morning", "midnight", "storm", "sunny"]
    sunny, midnight = load_weather("sunny"), load_weather("midnight")
    storm, fog = load_weather("storm"), load_weather("foggy_morning")
    assert sunny.sun_elevation > 45 > 0 > midnight.sun_elevation
    assert (sunny.lamps_on, midnight.lamps_on, fog.lamps_on) == (False, True, True)
    assert storm.precipitation == "rain"
    assert storm.friction_scale < fog.friction_scale < sunny.friction_scale == 1.0
    assert fog.visual_range < 200
    assert 0 < fog.sun_elevation < 15


def test_extinction_leaves_two_percent_contrast_at_visual_range() -> None:
    """At the visual range, 2 % of the contrast is left."""
    fog = Weather(visual_range=80.0)
    assert math.exp(-fog.extinction * 80.0) == pytest.approx(0.02)
    assert fog.fog_extinction == pytest.approx(3.912 / 80.0, rel=1e-4)


def test_rain_and_snow_attenuation_equals_itu_r_p_1814() -> None:
    """25 mm/h of rain: 1.076 · 25^0.67 = 9.30 dB/km; 2 mm/h of dry snow: 5.5253 · 2^1.38 = 14.38 dB/km."""
    rain = Weather(precipitation="rain", precipitation_intensity=25.0)
    assert rain.precipitation_extinction == pytest.approx(9.30 * math.log(10) / 10 / 1000, rel=1e-3)
    snow = Weather(precipitation="snow", precipitation_intensity=2.0)
    assert snow.precipitation_extinction == pytest.approx(14.38 * math.log(10) / 10 / 1000, rel=1e-3)


def test_friction_scale_by_wetness_and_snow() -> None:
    assert Weather().friction_scale == 1.0
    assert Weather(wetness=1.0).friction_scale == pytest.approx(0.59)
    assert Weather(wetness=1.0, friction=0.9).friction_scale == 0.9
    assert Weather(precipitation="snow", precipitation_intensity=1.0).friction_scale == pytest.approx(0.235)


def test_sun_direction_follows_azimuth_and_elevation() -> None:
    assert Weather(sun_azimuth=0.0, sun_elevation=0.0).sun_direction == pytest.approx((0.0, 1.0, 0.0))
    assert Weather(sun_azimuth=90.0, sun_elevation=30.0).sun_direction == pytest.approx(
        (math.cos(math.pi / 6), 0.0, 0.5)
    )


def test_invalid_weather_file_is_an_error_with_line(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("cloud_cover: 1.4\nvisual_rage: 50\nprecipitation: hail\n")
    with pytest.raises(SettingError) as caught:
        load_weather(wrong)
    text = str(caught.value)
    assert f"{wrong}:1: setting 'cloud_cover' is 1.4" in text
    assert f"{wrong}:2: unknown setting 'visual_rage'; did you mean 'visual_range'?" in text
    assert f"{wrong}:3: setting 'precipitation' is 'hail'" in text
    wrong.write_text("precipitation_intensity: 3.0\n")
    with pytest.raises(SettingError, match="needs `precipitation: rain`"):
        load_weather(wrong)
    wrong.write_text("- 1\n")
    with pytest.raises(SettingError, match="weather is not a mapping"):
        load_weather(wrong)
    with pytest.raises(SettingError, match=r"--weather: no weather preset 'sunni'.*did you mean 'sunny'"):
        load_weather("sunni", origin="--weather")


def test_weather_from_complete_environment() -> None:
    weather = weather_from_environment(
        Environment(
            name="Wet",
            friction=0.6,
            wetness="wetWithPuddles",
            clouds="sixOktas",
            sun_azimuth=math.pi / 2,
            sun_elevation=0.5,
            illuminance=40_000.0,
            fog_range=300.0,
            precipitation="rain",
            precipitation_intensity=8.0,
            wind_direction=math.pi,
            wind_speed=4.0,
        )
    )
    assert weather == Weather(
        name="Wet",
        friction=0.6,
        wetness=0.5,
        cloud_cover=0.75,
        sun_azimuth=90.0,
        sun_elevation=math.degrees(0.5),
        sun_illuminance=40_000.0,
        visual_range=300.0,
        precipitation="rain",
        precipitation_intensity=8.0,
        wind_direction=180.0,
        wind_speed=4.0,
    )


def test_weather_from_empty_environment_is_default() -> None:
    assert weather_from_environment(Environment()) == Weather(friction=1.0)
    assert weather_from_environment(Environment(friction=0.0)).friction_scale > 0.0
    assert (
        weather_from_environment(Environment(precipitation="rain", precipitation_share=0.2)).precipitation_intensity
        == 10.0
    )
    assert weather_from_environment(Environment(precipitation="dry", precipitation_share=0.2)).precipitation == "none"


def test_sun_intensity_up_to_one_is_a_share() -> None:
    weather = weather_from_environment(Environment(sun_azimuth=0.0, sun_elevation=1.31, illuminance=0.85))
    assert (weather.sun_share, weather.sun_illuminance) == (0.85, None)


def test_sun_elevation_beyond_zenith_is_on_the_opposite_side() -> None:
    assert weather_from_environment(
        Environment(sun_azimuth=0.0, sun_elevation=math.pi / 2)
    ).sun_elevation == pytest.approx(90.0)
    assert weather_from_environment(
        Environment(sun_azimuth=0.0, sun_elevation=math.pi * 0.75)
    ).sun_elevation == pytest.approx(45.0)
    assert weather_from_environment(Environment(sun_azimuth=0.0, sun_elevation=-1.1)).lamps_on


def test_sun_beyond_zenith_shines_from_the_opposite_side() -> None:
    """Unit vector of azimuth 0 and elevation 135 degrees: y = cos 135, z = sin 135."""
    weather = weather_from_environment(Environment(sun_azimuth=0.0, sun_elevation=math.pi * 0.75))
    assert weather.sun_direction == pytest.approx((0.0, -math.sqrt(0.5), math.sqrt(0.5)))


@pytest.mark.parametrize("setting", ["visual_range: 1.0e-310", "sun_illuminance: 1.0e+39", "street_lighting: 1.0e+39"])
def test_weather_beyond_single_precision_is_an_error(setting: str, tmp_path: Path) -> None:
    (tmp_path / "w.yaml").write_text(setting)
    with pytest.raises(SettingError, match=rf"w.yaml:1: setting '{setting.split(':')[0]}' is"):
        load_weather(tmp_path / "w.yaml")


def test_environment_of_huge_numbers_gives_finite_weather() -> None:
    """Turns of 2 pi; 1e308 rad are not a finite number of degrees."""
    huge = Environment(sun_azimuth=1e308, sun_elevation=0.5, illuminance=1e39, wind_direction=1e308)
    weather = weather_from_environment(huge)
    turn = math.degrees(math.fmod(1e308, 2.0 * math.pi))
    assert (weather.sun_azimuth, weather.wind_direction, weather.sun_illuminance) == (turn, turn, 1e9)


def test_solar_position_at_solstices_and_equinox() -> None:
    """At noon of a solstice at 48 degrees north the sun is 90 - 48 ± 23.45 degrees high in the south.

    At an equinox it rises in the east at six.
    """
    assert solar_position(datetime(2026, 6, 21, 12)) == pytest.approx((180.0, 65.45), abs=0.1)
    assert solar_position(datetime(2026, 12, 21, 12)) == pytest.approx((180.0, 18.55), abs=0.1)
    azimuth, elevation = solar_position(datetime(2026, 3, 22, 6))
    assert (azimuth, elevation) == pytest.approx((90.0, 0.0), abs=0.6)
    night = weather_from_environment(Environment(date_time="2026-06-21T00:00:00"))
    assert night.sun_elevation == pytest.approx(-18.55, abs=0.1)
    running = Environment(date_time="2026-06-21T00:00:00", clock_runs=True, clock_since=5.0)
    assert weather_from_environment(running, 12 * 3600.0 + 5.0).sun_elevation == pytest.approx(65.45, abs=0.1)


@pytest.mark.parametrize("grip", [1.0, 0.5, 0.2])
def test_braking_distance_grows_on_slippery_road(car: Callable[..., ActorSpec], grip: float) -> None:
    """From 12 m/s with full brakes (8 m/s²), or with the grip of the tires (grip · 9.81 m/s²): v² / 2 a."""
    with World() as world:
        world.set_weather(Weather(friction=grip))
        world.add(car("Ego"), Placement(0.0, 0.0, speed=12.0), driven=True)
        while world.view().speed[0] > 0.05:
            world.step({}, {"Ego": Control(brake=1.0)})
        assert world.view().position[0, 0] == pytest.approx(12.0**2 / 2 / min(8.0, grip * 9.81), rel=0.05)


def test_set_weather_changes_weather_and_friction() -> None:
    with World() as world:
        assert world.weather == Weather()
        world.set_weather(load_weather("storm"))
        assert world.weather.name == "storm"
        assert world.weather.friction_scale == pytest.approx(1 - 0.41 * 0.8)
