"""Environmental conditions of OSI by the environment of the scenario."""

from __future__ import annotations

import json
import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from written_recording import view, write_run

from eidrive_scenario.export.osi.ground_truth import GroundTruthBuilder
from eidrive_scenario.export.osi.schemas import Osi
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.world.environment import Environment


def conditions(environment: Environment) -> Any:
    with TemporaryDirectory() as folder:
        run = write_run(Path(folder), [Frame(view({"A": {}}), environment=environment)])
        (message,) = map(GroundTruthBuilder(Osi(), run).build, run.frames())
    return message.environmental_conditions


def test_environment_is_in_classes_of_standard() -> None:
    """By the definitions in osi_environment.proto: 2 mm/h moderate, 150 m thick fog, above 10000 lx level 9."""
    environment = Environment(
        date_time="2026-06-01T10:30:15",
        precipitation="rain",
        precipitation_intensity=2.0,
        fog_range=150.0,
        illuminance=15_000.0,
        temperature=280.0,
        pressure=100_000.0,
    )
    found = conditions(environment)
    kinds = type(found)
    assert kinds.Precipitation.Name(found.precipitation) == "PRECIPITATION_MODERATE"
    assert kinds.Fog.Name(found.fog) == "FOG_THICK"
    assert kinds.AmbientIllumination.Name(found.ambient_illumination) == "AMBIENT_ILLUMINATION_LEVEL9"
    assert (found.temperature, found.atmospheric_pressure) == (280.0, 100_000.0)
    assert found.time_of_day.seconds_since_midnight == 10 * 3600 + 30 * 60 + 15


@pytest.mark.parametrize(
    ("environment", "level"),
    [
        (Environment(sun_azimuth=0.0, sun_elevation=1.31, illuminance=0.85), 9),
        (Environment(sun_azimuth=0.0, sun_elevation=-0.35, illuminance=100_000.0), 2),
        (Environment(date_time="2026-06-21T12:00:00"), 9),
        (Environment(date_time="2026-12-21T00:00:00", clouds="overcast"), 2),
        (Environment(sun_azimuth=0.0, sun_elevation=0.1, illuminance=1000.0, clouds="overcast"), 8),
    ],
)
def test_ambient_illumination_follows_the_sun(environment: Environment, level: int) -> None:
    """Full daylight is level 9. A night of a town has 0.02 lx, whatever light the sun below the horizon has.

    A sun of 1000 lx 0.1 rad above the horizon and its sky, 0.8 klx + 15.5 klx sqrt(0.1), give 5.8 klx, and a quarter of
    that under full clouds.
    """
    found = conditions(environment)
    assert type(found).AmbientIllumination.Name(found.ambient_illumination) == f"AMBIENT_ILLUMINATION_LEVEL{level}"


def test_precipitation_without_unit_is_a_share_of_heavy_rain() -> None:
    """In files of version 1.0, 0.5 stands for 25 mm/h, which is heavy."""
    environment = Environment(precipitation="rain", precipitation_share=0.5)
    found = conditions(environment)
    assert type(found).Precipitation.Name(found.precipitation) == "PRECIPITATION_HEAVY"


@pytest.mark.parametrize(
    ("clouds", "name"),
    [
        ("zeroOktas", "ZERO_OKTAS"),
        ("threeOktas", "THREE_OKTAS"),
        ("eightOktas", "EIGHT_OKTAS"),
        ("nineOktas", "SKY_OBSCURED"),
        ("free", "ZERO_OKTAS"),
        ("overcast", "EIGHT_OKTAS"),
    ],
)
def test_clouds_are_in_eighths_of_the_sky(clouds: str, name: str) -> None:
    found = conditions(Environment(clouds=clouds)).clouds
    assert type(found).FractionalCloudCover.Name(found.fractional_cloud_cover) == f"FRACTIONAL_CLOUD_COVER_{name}"


@pytest.mark.parametrize(
    ("cover", "name"), [(0.0, "ZERO"), (0.01, "ONE"), (0.5, "FOUR"), (0.99, "SEVEN"), (1.0, "EIGHT")]
)
def test_only_a_full_sky_has_eight_eighths(tmp_path: Path, cover: float, name: str) -> None:
    metadata = {"settings": json.dumps({"weather_profile": {"cloud_cover": cover}})}
    run = write_run(tmp_path, [Frame(view({"A": {}}))], metadata=metadata)
    builder = GroundTruthBuilder(Osi(), run)
    (found,) = (builder.build(frame).environmental_conditions.clouds for frame in run.frames())
    assert type(found).FractionalCloudCover.Name(found.fractional_cloud_cover) == f"FRACTIONAL_CLOUD_COVER_{name}_OKTAS"


@pytest.mark.parametrize(
    ("towards", "origin"),
    [(0.0, 0.5), (0.5, 1.0), (1.0, 1.5), (1.5, 0.0), (-0.5, 0.0), (2.25, 0.75)],
    ids=["east", "north", "west", "south", "south negative", "northeast"],
)
def test_wind_comes_from_where_it_does_not_blow_to(towards: float, origin: float) -> None:
    """OpenSCENARIO: target of the wind from x (east) over y. OSI: its origin from north (y) over west."""
    found = conditions(Environment(wind_direction=towards * math.pi, wind_speed=7.5)).wind
    assert found.origin_direction == pytest.approx(origin * math.pi)
    assert found.speed == 7.5


def test_sun_has_azimuth_counterclockwise_from_north() -> None:
    """An azimuth of pi/2 is east in OpenSCENARIO and west in OSI. At noon the sun of the north is in the south."""
    found = conditions(Environment(sun_azimuth=math.pi / 2.0, sun_elevation=0.7, illuminance=60_000.0)).sun
    assert (found.azimuth, found.elevation) == pytest.approx((1.5 * math.pi, 0.7))
    assert found.intensity == pytest.approx(60_000.0)
    noon = conditions(Environment(date_time="2026-06-21T12:00:00")).sun
    assert noon.azimuth == pytest.approx(math.pi)
    assert math.degrees(noon.elevation) == pytest.approx(90.0 - 48.0 + 23.45, abs=0.1)
    night = conditions(Environment(date_time="2026-06-21T00:00:00")).sun
    assert night.elevation < 0.0
    assert night.intensity == 0.0


def test_intensity_of_the_sun_is_that_of_the_scenario() -> None:
    """OSI and OpenSCENARIO both have the illuminance of the sun, which clouds, fog, and snow do not change."""
    environment = Environment(
        sun_azimuth=0.4,
        sun_elevation=0.3,
        illuminance=10_000.0,
        precipitation="snow",
        precipitation_intensity=10.0,
        fog_range=100.0,
        clouds="sevenOktas",
    )
    assert conditions(environment).sun.intensity == pytest.approx(10_000.0)


def test_environment_without_sky_has_no_clouds_wind_and_sun() -> None:
    found = conditions(Environment(temperature=280.0, clouds="skyOff"))
    assert not any(found.HasField(name) for name in ("clouds", "wind", "sun"))


def test_weather_option_replaces_that_of_the_scenario(tmp_path: Path) -> None:
    """A night with 5 lx of street lamps (level 4), rain of 10 mm/h (heavy), 100 m visual range (thick fog)."""
    profile = {"sun_elevation": -40, "street_lighting": 5, "precipitation": "rain", "precipitation_intensity": 10}
    metadata = {"settings": json.dumps({"weather_profile": profile | {"visual_range": 100}})}
    day = Environment(date_time="2026-06-21T12:00:00", fog_range=20_000.0, precipitation="dry", temperature=280.0)
    run = write_run(tmp_path, [Frame(view({"A": {}}), environment=day), Frame(view({"A": {}}, 1))], metadata=metadata)
    builder = GroundTruthBuilder(Osi(), run)
    for frame in run.frames():
        found = builder.build(frame).environmental_conditions
        kinds = type(found)
        assert kinds.AmbientIllumination.Name(found.ambient_illumination) == "AMBIENT_ILLUMINATION_LEVEL4"
        assert kinds.Precipitation.Name(found.precipitation) == "PRECIPITATION_HEAVY"
        assert kinds.Fog.Name(found.fog) == "FOG_THICK"
        assert found.HasField("temperature") == (frame.environment is not None)
    assert write_run(tmp_path, [Frame(view({"A": {}}))]).weather is None
