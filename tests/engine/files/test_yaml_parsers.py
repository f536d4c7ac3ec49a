"""Both parsers of YAML: that of libyaml reads texts as that in Python does, within the same limits."""

from __future__ import annotations

import pytest
import yaml

from eidrive_scenario.errors import SettingError
from eidrive_scenario.files.yaml_text import MAX_DEPTH, MAX_NODES, load_yaml, load_yaml_text

OBJECTS = """# objects of a frame
lidar_pose:
- -12.5
- 3.0e+0
- 1.9
vehicles:
  107: {angle: [0.0, 90.0, 0.0], extent: [2.4, 1.0, 0.75], obj_type: 'car'}
  108:
    angle: [0.0, -1e-05, .5]
    obj_type: "a: \
word"   # text with a colon
"""


@pytest.fixture(params=[True, False], ids=["libyaml", "Python"])
def parser(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param and not yaml.__with_libyaml__:
        pytest.skip("PyYAML without libyaml")
    monkeypatch.setattr(yaml, "__with_libyaml__", request.param)


def padded(text: str) -> str:
    """Return the text with a comment that makes it too long to be kept in the process."""
    return f"{text}\n#{'.' * 5000}\n"


@pytest.mark.usefixtures("parser")
def test_yaml_of_a_dataset_has_its_values_and_lines_by_each_parser() -> None:
    text = padded(OBJECTS)
    data, lines = load_yaml_text(text, source="")
    assert data == {
        "lidar_pose": [-12.5, 3.0, 1.9],
        "vehicles": {
            107: {"angle": [0.0, 90.0, 0.0], "extent": [2.4, 1.0, 0.75], "obj_type": "car"},
            108: {"angle": [0.0, "-1e-05", 0.5], "obj_type": "a: word"},
        },
    }
    assert (lines["lidar_pose.2"], lines["vehicles.107.extent"], lines["vehicles.108.obj_type"]) == (5, 7, 10)


@pytest.mark.usefixtures("parser")
@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("a:\n- &x 1\n- *x\n", "x:2: not valid YAML: anchors and aliases are not supported"),
        ("a:\n  <<: 1\n", "x:2: not valid YAML: merge keys are not supported"),
        ("b: 1\na: " + "[" * MAX_DEPTH + "]" * MAX_DEPTH, "x:2: not valid YAML: nested too deeply"),
        ("\n[" + "1," * MAX_NODES + "]", f"x:2: not valid YAML: more than {MAX_NODES} values"),
        ("a: 1\nb: 2\na: 3\n", "x:3: not valid YAML: duplicate key 'a'"),
        ("1: a\nb: 2\n1.0: c\n", "x:3: not valid YAML: duplicate key '1.0'"),
        ("a: 1\nb: " + "1" * 41, "x:2: not valid YAML: a number has more than 40 digits"),
        ("a: 1\nb: [1}\n", "x:2: not valid YAML: expected ',' or ']', but got '}'"),
    ],
)
def test_limits_and_errors_are_the_same_by_each_parser(text: str, error: str) -> None:
    with pytest.raises(SettingError) as caught:
        load_yaml(padded(text), source="x")
    assert str(caught.value).startswith(error)
