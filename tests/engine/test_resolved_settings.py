"""All settings of a run: complete, in one JSON form, with one hash."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.base.content_digest import canonical_json
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings

ONE = library_path() / "coop" / "scenario_1.xosc"
PASSING_BY = Path(__file__).parents[1] / "data" / "passing_by.xosc"
LATE = "{delay: {kind: constant, seconds: 0.2}}"


def resolve(source: Any = ONE, seed: int = 1, **settings: Any) -> ResolvedSettings:
    chosen = RunSettings(**settings)
    with Simulation(load_for_seed(source, seed, chosen.parameters), seed=seed, settings=chosen) as simulation:
        return simulation.resolved


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Scenario 1 of the library with its roads and catalogs, to be changed."""
    for name in ("roads", "catalogs", "channels"):
        shutil.copytree(library_path() / name, tmp_path / name)
    (tmp_path / "coop").mkdir()
    return Path(shutil.copy(ONE, tmp_path / "coop"))


def test_settings_of_the_library_hold_channel_stations_and_draws() -> None:
    found = resolve(seed=3)
    assert (found.scenario, found.seed, found.channel) == ("coop/scenario_1", 3, "ideal")
    assert found.channel_profile is not None
    assert found.channel_profile["delay"] == {"kind": "constant", "seconds": 0.0}
    assert found.stations["Ego"]["detector"] == "oracle"
    assert found.stations["Ego"]["cooperates_with"] == ["RSU"]
    assert set(found.drawn) == {"EgoOffset", "EgoSpeedOffset", "IncomingOffset", "IncomingSpeedOffset"}
    assert abs(float(found.parameters["EgoOffset"])) <= 0.15
    assert [role for role, _, _ in found.files] == ["scenario", "catalog", "catalog", "road"]
    assert found.versions["eidrive-scenario"]


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"seed": 2}, "seed"),
        ({"channel": "none"}, "channel"),
        ({"channel": LATE}, "channel_profile"),
        ({"detector": "lidar"}, "stations"),
        ({"cooperate": ()}, "stations"),
        ({"weather": "storm"}, "weather_profile"),
        ({"parameters": {"EgoSpeed": "8.0"}}, "parameters"),
        ({"user_values": {"mood": "3"}}, "user_values"),
        ({"controllers": {"ALKS": "alks"}}, "controllers"),
        ({"dt": 0.1}, "dt"),
        ({"time_limit": 60.0}, "time_limit"),
    ],
)
def test_each_setting_changes_the_hash_and_its_entry(changes: dict[str, Any], key: str) -> None:
    usual, changed = resolve(), resolve(**changes)
    assert changed.digest != usual.digest
    assert changed.as_json()[key] != usual.as_json()[key]


def test_value_equal_to_default_keeps_the_digest() -> None:
    assert resolve(channel="ideal", dt=0.05).digest == resolve().digest


def test_inline_channels_differ_by_content() -> None:
    one, other = (resolve(channel=f"{{delay: {{kind: constant, seconds: {late}}}}}") for late in (0.1, 0.2))
    assert one.channel == other.channel == "custom"
    assert one.digest != other.digest
    assert one.channel_profile is not None
    assert one.channel_profile["delay"]["seconds"] == 0.1


def _edit(path: Path, before: str, after: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after), encoding="utf-8")


def _channel(text: str) -> Callable[[Path], Path]:
    def write(scenario: Path) -> Path:
        path = scenario.parent / "channel.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("name", ["coop/scenario_1.xosc", "catalogs/vehicles.xosc", "roads/coop_1.xodr"])
def test_changed_file_of_equal_name_changes_the_digest(project: Path, name: str) -> None:
    before = resolve(project)
    path = project.parents[1] / name
    path.write_bytes(path.read_bytes().rstrip() + b"\n<!-- changed -->\n")
    assert resolve(project).digest != before.digest


def test_channel_file_is_identified_by_content(project: Path) -> None:
    found = [
        resolve(project, channel=_channel(f"delay: {{kind: constant, seconds: {late}}}\n")(project))
        for late in (0.1, 0.3)
    ]
    assert [one.channel for one in found] == ["channel", "channel"]
    assert found[0].digest != found[1].digest


def test_delay_trace_is_identified_by_content(project: Path) -> None:
    channel = _channel("delay: {kind: trace, file: trace.csv}\n")(project)
    digests = set()
    for text in ("0.1\n0.2\n", "0.1\n0.3\n"):
        (project.parent / "trace.csv").write_text(text, encoding="utf-8")
        found = resolve(project, channel=channel)
        assert ("setting", "trace.csv") in {(role, name) for role, name, _ in found.files}
        assert str(project.parent) not in found.canonical
        digests.add(found.digest)
    assert len(digests) == 2


def test_settings_of_a_copy_in_another_folder_are_equal(project: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(project.parents[1], tmp_path / "elsewhere" / "project") / "coop" / project.name
    assert resolve(copy) == resolve(project)


def test_channels_of_later_events_are_resolved(project: Path) -> None:
    command = '<Action name="switch"><UserDefinedAction><CustomCommandAction type="eidrive.channel">{}'
    command += "</CustomCommandAction></UserDefinedAction></Action>\n"
    text = project.read_text(encoding="utf-8")
    event = text.index("<Action name=", text.index("<Event"))
    found = []
    for late in (0.1, 0.2):
        switch = command.format(f"{{delay: {{kind: constant, seconds: {late}}}}}")
        project.write_text(text[:event] + switch + text[event:], encoding="utf-8")
        found.append(resolve(project))
    assert [one.later_channels[0]["delay"]["seconds"] for one in found if one.later_channels[0]] == [0.1, 0.2]
    assert found[0].channel == "ideal"
    assert resolve(project, channel="ideal").later_channels == (), "an option replaces all channels of the file"


def test_scenario_in_memory_is_identified_by_content() -> None:
    text = PASSING_BY.read_bytes()
    assert resolve(text).digest != resolve(text.replace(b"passing", b"driving") + b" ").digest


def test_digest_is_equal_in_another_process() -> None:
    code = (
        "import sys; from eidrive_scenario.simulation import *;"
        f"s = Simulation(load_for_seed({str(ONE)!r}, 1, {{}}), seed=1); print(s.resolved.digest); s.close()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == resolve().digest


def test_canonical_json_does_not_depend_on_order() -> None:
    first, second = {"b": 1, "a": {"d": 2, "c": "ä"}}, {"a": {"c": "ä", "d": 2}, "b": 1}
    assert canonical_json(first) == canonical_json(second) == '{"a":{"c":"\\u00e4","d":2},"b":1}'


def test_nonfinite_values_are_written_as_text() -> None:
    odd = replace(ResolvedSettings(), channel_profile={"limit": float("inf"), "set": frozenset({"b", "a"})})
    assert json.loads(odd.canonical)["channel_profile"] == {"limit": "inf", "set": ["a", "b"]}
