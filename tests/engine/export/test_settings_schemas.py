"""JSON schemas of YAML files: all files of the library are valid, and mistakes are not."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from command_fixtures import Eidrive, eidrive
from json_schema import is_valid

from eidrive_scenario.driving.settings import NAME_PROPERTIES
from eidrive_scenario.export.settings_schemas import SCHEMAS, settings_schema
from eidrive_scenario.extensions.library import definition, library_path
from eidrive_scenario.files.yaml_text import load_yaml, load_yaml_file
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries

__all__ = ["eidrive"]

schema_of = cache(settings_schema)


def is_accepted(kind: str, text: str) -> bool:
    return is_valid(schema_of(kind), load_yaml(text, source=""))


def shipped(kind: str) -> Iterator[tuple[str, Any]]:
    """Yield the YAML of a kind in the files of the library, as it is before references are resolved."""
    if kind in ("channel", "weather"):
        for path in sorted((library_path() / {"channel": "channels"}.get(kind, kind)).glob("*.yaml")):
            yield path.name, load_yaml_file(path)[0]
    for path in sorted(library_path().rglob("*.xosc")):
        if definition(path) != "scenario":
            continue
        scenario = load_scenario(path)
        for command in scenario.custom_commands:
            if command.type == {"criteria": "eidrive.criterion", "channel": "eidrive.channel"}.get(kind):
                content = load_yaml(command.content, source=str(path))
                if not isinstance(content, str):
                    yield path.name, content
        for name, controllers in scenario.controllers.items() if kind == "stack" else ():
            for controller in filter(is_agent_controller, controllers):
                yield (
                    f"{path.name} {name}",
                    {
                        entry.name: entry.value if entry.name in NAME_PROPERTIES else load_yaml(entry.value, source="")
                        for entry in property_entries(controller)
                    },
                )


def with_unknown_keys(value: Any) -> Iterator[Any]:
    """Yield copies of a value with an unknown key in one of its mappings each."""
    if isinstance(value, dict):
        yield {**value, "unknwon": 1}
    for key, part in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        for changed in with_unknown_keys(part):
            copy = deepcopy(value)
            copy[key] = changed
            yield copy


@pytest.mark.parametrize(("kind", "least"), [("stack", 80), ("channel", 13), ("criteria", 100), ("weather", 4)])
def test_files_of_the_library_are_valid_and_unknown_keys_are_not(kind: str, least: int) -> None:
    files = list(shipped(kind))
    assert len(files) >= least
    assert [name for name, content in files if not is_valid(schema_of(kind), content)] == []
    distinct = {json.dumps(content, sort_keys=True): content for _, content in files}
    wrong = [changed for content in distinct.values() for changed in with_unknown_keys(content)]
    assert [content for content in wrong if is_valid(schema_of(kind), content)] == []


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("stack", "{detector: lidar, detector_settings: {min_points: 4}, sensors: [lidar]}"),
        ("stack", "{fusion_settings: {gate: 0.9}}"),
        ("stack", "{fusion: early, fusion_settings: {max_lateness: 0.2}, detector: lidar}"),
        ("stack", "{planner: conflict_area, conflict_area: [0, 10, 2, 4], cooperates_with: all, messages: 'cpm, cam'}"),
        ("stack", "{planner: none, tracker: none, mount: [1, 0, 2], cooperates_with: [RSU]}"),
        ("stack", "{tracker: {kind: ctrv, confirm: [2, 4]}, sensors: {camera: null, a: {kind: camera, mount: left}}}"),
        ("stack", "{sensors: {camera: {noise: off, distortion: [0.1]}}, detector: $Detector, message_rate: $Rate}"),
        ("channel", "{delay: {seconds: 0.3}}"),
        ("channel", "{delay: {kind: trace, file: delays.csv, unit: ms}, loss: {kind: bernoulli, probability: $Loss}}"),
        ("channel", "{model: radio, packet_errors: 80211p_goubet, fading: {kind: nakagami, m: 3}}"),
        ("criteria", "{collision: {of: Ego}, min_distance: {of: Ego, to: Other, at_least: $Least, name: gap}}"),
        ("criteria", "[{collision: {of: Ego}}, {collision: {of: Other}}]"),
    ],
)  # fmt: skip
def test_documented_forms_are_valid(kind: str, text: str) -> None:
    assert is_accepted(kind, text)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("stack", "{detector: lidra}"),
        ("stack", "{detectr: lidar}"),
        ("stack", "{detector: oracle, detector_settings: {min_points: 4}}"),
        ("stack", "{detector: lidar, detector_settings: {min_point: 4}}"),
        ("stack", "{fusion_settings: {gates: 0.9}}"),
        ("stack", "{fusion: average, fusion_settings: {gate: 0.9}}"),
        ("stack", "{planner: behavior, planner_settings: {conflict_area: [0, 10, 2, 4]}}"),
        ("stack", "{tracker: {kind: ctr}}"),
        ("stack", "{sensors: {left: {mount: left}}}"),
        ("stack", "{sensors: {camera: {widht: 10}}}"),
        ("stack", "{sensors: [kamera]}"),
        ("stack", "{message_rate: often}"),
        ("stack", "{visibility: 2}"),
        ("channel", "{model: radioo}"),
        ("channel", "{delay: {kind: constant, second: 0.3}}"),
        ("channel", "{delay: {kind: trace}}"),
        ("channel", "{model: radio, frequency: 5.9}"),
        ("channel", "{frequency_ghz: 5.9}"),
        ("criteria", "{colision: {of: Ego}}"),
        ("criteria", "{min_distance: {of: Ego, at_least: 1}}"),
        ("criteria", "{}"),
        ("weather", "{rian: 1}"),
    ],
)
def test_mistakes_are_not_valid(kind: str, text: str) -> None:
    assert not is_accepted(kind, text)


@pytest.mark.parametrize("kind", SCHEMAS)
def test_command_prints_and_writes_the_schema(eidrive: Eidrive, tmp_path: Path, kind: str) -> None:
    printed = json.loads(eidrive("schema", kind).stdout)
    assert printed == schema_of(kind)
    assert printed["$schema"] == "http://json-schema.org/draft-07/schema#"
    out = tmp_path / "new" / f"{kind}.json"
    assert eidrive("schema", kind, "--out", out).stdout == f"{out}\n"
    assert json.loads(out.read_text(encoding="utf-8")) == printed


EXTENSION = """
from eidrive_scenario.api.criteria import Criterion, CriterionSettings

class LimitSettings(CriterionSettings):
    of: str
    größe: float = 6.0

class Limit(Criterion):
    settings_type = LimitSettings
    def observe(self, frame): pass
    def verdict(self): pass
"""


@pytest.mark.process
def test_extensions_of_a_project_are_part_of_the_schema(tmp_path: Path) -> None:
    """A criterion of the project has its settings; one that does not load takes any."""
    (tmp_path / "my_limit.py").write_text(EXTENSION, encoding="utf-8")
    (tmp_path / "pyproject.toml").write_text(
        '[tool.eidrive]\npythonpath = ["."]\n[project.entry-points."eidrive_scenario.criteria"]\n'
        'limit = "my_limit:Limit"\nbroken = "my_limit:Missing"\n',
        encoding="utf-8",
    )
    words = [sys.executable, "-m", "eidrive_scenario", "--project", str(tmp_path), "schema", "criteria"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    schema = json.loads(done.stdout)
    assert is_valid(schema, {"limit": {"of": "Ego", "größe": 2}})
    assert not is_valid(schema, {"limit": {"of": "Ego", "grösse": 2}})
    assert is_valid(schema, {"broken": {"any": 1}, "collision": {"of": "Ego"}})
    assert done.stderr.startswith("warning: the schema accepts any settings: ")
    assert "my_limit:Missing" in done.stderr
