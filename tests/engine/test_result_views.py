"""Views of a result: one line, one flat row, and HTML."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser

import pytest

from eidrive_scenario.errors import FAILED
from eidrive_scenario.evaluation import Verdict
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings
from eidrive_scenario.simulation.result import RunResult, typed

PROFILE = {"model": "composed", "delay": {"kind": "trace", "seconds": [0.1, 0.2]}, "own_perception": False}
RESULT = RunResult(
    scenario="street",
    seed=3,
    channel="custom",
    passed=False,
    end_reason="stop trigger",
    exit_code=FAILED,
    criteria=(
        Verdict("collision", False, 1.0, 0.0, "", 2.5, "A & B hit each other <hard>", True),
        Verdict("reach", True, None, None, "s", None, "reached"),
    ),
    metrics={"collision.count": 1.0, "messages.sent": 12},
    trace_hash="ab" * 32,
    simulated_s=2.5,
    wall_s=0.1,
    warnings=("<script>alert(1)</script>",),
    parameters={"Latency": "0.2", "Lanes": "3", "Road": "007", "Side": "left"},
    settings=ResolvedSettings(channel="custom", channel_profile=PROFILE),
)


def test_str_of_result_is_one_line() -> None:
    assert str(RESULT) == "street, seed 3, channel custom: failed by collision (stop trigger at 2.50 s, 1 warning)"
    passed = replace(RESULT, passed=True, criteria=(), warnings=(), run=4)
    assert str(passed) == "street, run 4, seed 3, channel custom: passed (stop trigger at 2.50 s)"
    assert "not passed (time limit" in str(replace(passed, passed=False, end_reason="time limit"))


def test_to_dict_of_result_is_flat_and_scalar() -> None:
    row = RESULT.to_dict()
    assert all(value is None or isinstance(value, str | int | float | bool) for value in row.values())
    expected = {
        "scenario": "street",
        "run": None,
        "seed": 3,
        "passed": False,
        "warnings": 1,
        "parameter.Latency": 0.2,
        "parameter.Lanes": 3,
        "parameter.Road": "007",
        "parameter.Side": "left",
        "channel": "custom",
        "channel.delay.kind": "trace",
        "channel.delay.seconds": "[0.1, 0.2]",
        "channel.own_perception": False,
        "collision.passed": False,
        "collision.value": 1.0,
        "collision.limit": 0.0,
        "reach.passed": True,
        "reach.value": None,
        "collision.count": 1.0,
        "messages.sent": 12.0,
        "trace_hash": "ab" * 32,
    }
    assert {name: row[name] for name in expected} == expected


def test_to_dict_keeps_columns_that_have_the_name_of_a_metric() -> None:
    columns = replace(RESULT, metrics={"channel": 0.5, "seed": 9.0, "reach.passed": 0.0, "own": 1.0}).to_dict()
    assert (columns["channel"], columns["seed"], columns["reach.passed"], columns["own"]) == ("custom", 3, True, 1.0)


def test_to_dict_of_results_forms_a_data_frame() -> None:
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame([RESULT.to_dict(), replace(RESULT, seed=4, parameters={"Latency": "0.4"}).to_dict()])
    assert table["parameter.Latency"].tolist() == [0.2, 0.4]
    assert table["seed"].sum() == 7


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.2", 0.2),
        ("-3", -3),
        ("1e-3", 0.001),
        (".5", 0.5),
        ("0", 0),
        ("007", "007"),
        ("1234567890123456", 1234567890123456),
        ("12345678901234567890", "12345678901234567890"),
        ("00.5", "00.5"),
        ("1e999", "1e999"),
        ("INF", "INF"),
        ("nan", "nan"),
        ("true", "true"),
        ("", ""),
        ("1_000", "1_000"),
        ("٣", "٣"),
        (" 1", " 1"),
    ],
)
def test_typed_of_decimal_text_returns_number(text: str, value: object) -> None:
    assert typed(text) == value
    assert type(typed(text)) is type(value)


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def test_repr_html_of_result_escapes_every_text() -> None:
    parser = _Tags()
    hostile = replace(RESULT, scenario="<img src=x>", channel="<b>", end_reason="<i>")
    parser.feed(hostile._repr_html_())
    assert parser.tags <= {"div", "p", "b", "table", "thead", "tbody", "tr", "th", "td", "code", "ul", "li"}
    for text in (
        "<img src=x>",
        "A & B hit each other <hard>",
        "<script>alert(1)</script>",
        "channel <b>",
        "<i> at 2.50 s",
    ):
        assert text in parser.text
