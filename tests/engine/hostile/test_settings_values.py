"""Hostile values in every setting: each is refused as the user's mistake, or the run copes with it.

EIDRIVE_SETTINGS_TRIALS sets the number of runs; `all` runs every value that the settings accept.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args
from xml.sax.saxutils import escape

import pytest
import yaml
from criteria_values import CRITERIA
from hostile_scenario import Write, scenario_writer
from pydantic import BaseModel
from settings_values import CHANNELS, STATIONS, WEATHER, as_text, variants
from trial import attempt

from eidrive_scenario.driving.settings import AgentSettings, parse_station_settings
from eidrive_scenario.errors import InputError
from eidrive_scenario.evaluation.criteria_parser import CriteriaContext, parse_criteria
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.profile import load_profile
from eidrive_scenario.world.weather import Weather

COUNT = os.environ.get("EIDRIVE_SETTINGS_TRIALS", "16")
TABLES = {"station": STATIONS, "channel": CHANNELS, "weather": WEATHER, "criterion": CRITERIA}
CAMERA = "{truth: {}, camera: {width: 64, height: 48}, lidar: {channels: 16, points_per_second: 20000, rotation: 10}}"


def parsed(kind: str, name: str, data: Mapping[str, Any]) -> list[Settings]:
    """The models that settings are read into. Raises SettingError."""
    if kind == "station":
        station = parse_station_settings(data)
        inner = [("detectors", station.detector, station.detector_settings)]
        inner.append(("fusion", station.fusion, station.fusion_settings))
        types = [(registry(group).load(known, object).settings_type, given) for group, known, given in inner if given]
        return [station, *(parse_settings(model, given) for model, given in types)]
    if kind == "channel":
        profile = load_profile(data)
        assert profile is not None
        return [profile]
    if kind == "weather":
        return [parse_settings(Weather, data)]
    model = registry("criteria").load(name, object).settings_type
    return [parse_settings(model, data)]


def accepted(kind: str, name: str, data: Mapping[str, Any]) -> bool:
    """Whether settings are read without an error of the input; any other error is one of this program's own."""
    try:
        parsed(kind, name, data)
        if kind == "criterion":
            parse_criteria(as_text({name: data}), CriteriaContext(("Ego", "B")))
    except InputError:
        return False
    return True


def all_variants() -> Iterator[tuple[str, str, str, dict[str, Any]]]:
    """Kind, name of the base, what is changed, and the settings."""
    for kind, table in TABLES.items():
        for name, base in table.items():
            for what, data in variants(base):
                yield kind, name, what, data


def numeric_fields(model: type[BaseModel], seen: set[type[BaseModel]]) -> Iterator[tuple[type[BaseModel], str]]:
    """The fields of a model, and of those inside it, that hold a number."""
    if model in seen:
        return
    seen.add(model)
    for name, field in model.model_fields.items():
        parts = list(_parts(field.annotation))
        if any(part in (int, float) for part in parts):
            yield _owner(model, name), name
        for part in parts:
            if isinstance(part, type) and issubclass(part, BaseModel):
                yield from numeric_fields(part, seen)


def given_fields(value: Any) -> Iterator[tuple[type[BaseModel], str]]:
    """The fields that settings give explicitly, those of models inside them too."""
    if isinstance(value, BaseModel):
        for name in value.model_fields_set:
            yield _owner(type(value), name), name
            yield from given_fields(getattr(value, name))
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from given_fields(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from given_fields(inner)


def _parts(annotation: Any) -> Iterator[Any]:
    yield annotation
    for part in get_args(annotation):
        yield from _parts(part)


def _owner(model: type[BaseModel], field: str) -> type[BaseModel]:
    """The most general class that has a field."""
    return [kind for kind in model.__mro__ if field in getattr(kind, "model_fields", {})][-1]


def test_tables_contain_every_numeric_setting() -> None:
    roots: list[type[BaseModel]] = [AgentSettings, Weather]
    for group in ("detectors", "fusion", "criteria", "planners"):
        kinds = [registry(group).load(name, object) for name in registry(group)]
        roots += [kind.settings_type for kind in kinds if kind.settings_type is not None]
    roots += [registry("channels").load(name, Channel).settings_type for name in registry("channels")]
    seen: set[type[BaseModel]] = set()
    needed = {entry for root in roots for entry in numeric_fields(root, seen)}
    given = {
        entry
        for kind, table in TABLES.items()
        for name, base in table.items()
        for model in parsed(kind, name, base)
        for entry in given_fields(model)
    }
    with_files = {("LearnedSettings", name) for name in ("input_size", "confidence", "threads")}
    with_files |= {("OpenImagesSettings", "confidence"), ("OpenImagesSettings", "threads"), ("TraceDelay", "column")}
    missing = {(model.__name__, name) for model, name in needed - given}
    assert missing == with_files  # weights and a delay trace, which have separate tests


@pytest.mark.exhaustive
def test_setting_with_hostile_value_is_accepted_or_refused() -> None:
    counts = {True: 0, False: 0}
    for kind, name, what, data in all_variants():
        try:
            counts[accepted(kind, name, data)] += 1
        except Exception as error:
            pytest.fail(f"{kind} {name} with {what}: {error!r}")
    assert counts[True] > 500  # such as 3 in place of 10
    assert counts[False] > 5000


@pytest.mark.process
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the limits of a trial need Linux")
@pytest.mark.timeout(0)
def test_runs_with_accepted_hostile_values_end_without_internal_error(tmp_path: Path) -> None:
    """In a process with one thread: each trial is a fork, and locks of other threads would stay locked in it."""
    single = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    path = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, __file__, COUNT, str(tmp_path)],
        env=dict(os.environ) | single | path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "runs" in done.stdout


def scenario_with(write: Write, kind: str, name: str, data: Mapping[str, Any]) -> tuple[Path, Path | None]:
    """A scenario file with settings, and a file of weather if they are of one."""
    if kind == "station":
        return write({key: as_text(value) for key, value in data.items()}), None
    if kind == "channel":
        return write({"range": "50.0"}, channel=escape(as_text(data))), None
    if kind == "weather":
        path = write({"sensors": CAMERA})
        path.with_name("weather.yaml").write_text(yaml.safe_dump(dict(data)))
        return path, path.with_name("weather.yaml")
    text = escape(as_text({name: data}))
    command = f'<UserDefinedAction><CustomCommandAction type="eidrive.criterion">{text}</CustomCommandAction>'
    return write(init=f"{command}</UserDefinedAction>"), None


def main(count: str, folder: Path) -> int:
    """Run so many of the values that are accepted, drawn at random; report what is neither played nor refused."""
    write = scenario_writer(folder)
    cases = [case for case in all_variants() if accepted(case[0], case[1], case[3])]
    if count != "all":
        cases = random.Random(1).sample(cases, int(count))
    bad = 0
    for kind, name, what, data in cases:
        path, weather = scenario_with(write, kind, name, data)

        def run(path: Path, weather: Path | None = weather) -> None:
            settings = RunSettings(time_limit=0.4, weather=weather)
            Simulation(load_scenario(path), seed=1, settings=settings).run()

        outcome = attempt(path, run=run)
        if outcome.kind not in ("played", "refused"):
            bad += 1
            sys.stdout.write(f"{kind} {name} with {what}: {outcome.kind}\n{outcome.detail}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{len(cases)} runs, {bad} of them bad\n")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2])))
