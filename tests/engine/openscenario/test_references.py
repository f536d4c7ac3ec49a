"""References to parameters inside YAML settings."""

from __future__ import annotations

from typing import Any

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.files.yaml_text import load_yaml, load_yaml_text
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import ParameterDeclaration, ParameterType
from eidrive_scenario.openscenario.values.parameters import Scope, declare, hide_parameters, resolve_references


def scope_of(**parameters: tuple[ParameterType, str]) -> Scope:
    scope, collector = Scope(), DiagnosticCollector()
    for name, (kind, value) in parameters.items():
        declare(scope, ParameterDeclaration(name=name, parameter_type=kind, value=value), None, collector)
    assert not collector.errors
    return scope


SCOPE = scope_of(
    Latency=(ParameterType.DOUBLE, "0.2"),
    Count=(ParameterType.INTEGER, "3"),
    On=(ParameterType.BOOLEAN, "true"),
    Side=(ParameterType.STRING, "left"),
    Digits=(ParameterType.STRING, "0.5"),
    Forged=(ParameterType.STRING, "0.1}, loss: {kind: bernoulli, probability: 1.0"),
)


def resolved(text: str, scope: Scope | None = SCOPE) -> Any:
    data, lines = load_yaml_text(text, source="a.xosc")
    return resolve_references(data, scope, source="a.xosc", lines=lines)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("{seconds: $Latency}", 0.2),
        ("seconds: $Latency", 0.2),
        ("{seconds: '$Latency'}", 0.2),
        ("{seconds: ${$Latency * 2}}", 0.4),
        ("{seconds: ${max($Latency, 1, 0.5)}}", 1),
        ("{seconds: [${$Count - 1}, $Latency]}", [2, 0.2]),
        ("seconds: ${$Latency / 4}", 0.05),
        ("{seconds: $Count}", 3),
        ("{seconds: $On}", True),
        ("{seconds: ${not $On}}", False),
        ("{seconds: $Side}", "left"),
        ("{seconds: ${lane_ + $Side}}", "lane_left"),
        ("{seconds: $Digits}", "0.5"),
        ("{seconds: ${$Digits * 2}}", 1.0),
        ("{seconds: 5 $}", "5 $"),
        ("{seconds: $5}", "$5"),
    ],
)
def test_reference_has_value_and_type_of_parameter(text: str, value: object) -> None:
    found = resolved(text)
    assert found == {"seconds": pytest.approx(value) if isinstance(value, float) else value}
    assert type(found["seconds"]) is type(value)


def test_yaml_syntax_in_parameter_remains_text() -> None:
    assert resolved("{delay: {seconds: $Forged}}") == {
        "delay": {"seconds": "0.1}, loss: {kind: bernoulli, probability: 1.0"}
    }
    assert resolved("{$Side: 1}") == {"$Side": 1}


def test_value_of_a_parameter_is_not_resolved_again() -> None:
    scope = scope_of(First=(ParameterType.STRING, "$Second"), Second=(ParameterType.STRING, "secret"))
    assert resolved("{name: $First}", scope) == {"name": "$Second"}


@pytest.mark.parametrize(
    ("text", "diagnostic"),
    [
        ("{a: 1,\n b: {c: $Latncy}}", "a.xosc:2: setting 'b.c': unknown parameter $Latncy; did you mean 'Latency'?"),
        ("[1,\n $Sid]", "a.xosc:2: setting '1': unknown parameter $Sid; did you mean 'Side'?"),
        ("{a: ${$Latency +}}", "a.xosc:1: setting 'a': '$Latency +' is not an expression"),
        ("{a: ${1 / 0}}", "a.xosc:1: setting 'a': the expression '1 / 0' has no value"),
        ("{a: ${2 ** 3}}", "a.xosc:1: setting 'a': "),
    ],
)
def test_invalid_reference_error_has_line_and_key(text: str, diagnostic: str) -> None:
    with pytest.raises(SettingError) as caught:
        resolved(text)
    assert str(caught.value).startswith(diagnostic)


def test_invalid_references_are_reported_together() -> None:
    with pytest.raises(SettingError) as caught:
        resolved("{a: $X, b: [$Y, $Latency]}")
    assert [diagnostic.message.split(":")[0] for diagnostic in caught.value.diagnostics] == [
        "setting 'a'",
        "setting 'b.0'",
    ]


def test_settings_without_scope_are_unchanged() -> None:
    assert resolved("{a: $X}", None) == {"a": "$X"}


def test_hidden_parameter_is_unknown() -> None:
    inner = Scope(SCOPE)
    assert hide_parameters(inner, ["Side"]).evaluate("$Latency") == 0.2  # type: ignore[union-attr]
    with pytest.raises(SettingError, match=r"unknown parameter \$Side"):
        resolved("{a: $Side}", hide_parameters(inner, ["Side"]))


@pytest.mark.parametrize("text", ["{a: ${1 + 2}", "{a: ${1 + 2, b: 3}", "{a: ${{}}}", "{a: ${1}2}"])
def test_unclosed_expression_is_invalid_yaml(text: str) -> None:
    with pytest.raises(SettingError, match="not valid YAML"):
        load_yaml(text, source="a.xosc")


def test_changed_data_of_a_text_is_not_returned_again() -> None:
    text = "{limits: [1, 2], of: {name: Ego}}"
    data, lines = load_yaml_text(text, source="a.xosc")
    data["limits"].append(3)
    data["of"]["name"] = "Other"
    lines.clear()
    data, lines = load_yaml_text(text, source="a.xosc", line=7)
    assert data == {"limits": [1, 2], "of": {"name": "Ego"}}
    assert lines == {"limits": 7, "limits.0": 7, "limits.1": 7, "of": 7, "of.name": 7}
