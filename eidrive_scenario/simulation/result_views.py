"""Views of a run's result: one flat row for a table, and HTML for a notebook."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any, Protocol

from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.exit_codes import NOT_JUDGED
from eidrive_scenario.resolved_settings import ResolvedSettings

Scalar = str | int | float | bool | None

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WHOLE = re.compile(r"[+-]?(0|[1-9]\d{0,17})", re.ASCII)


class Result(Protocol):
    """The fields of a RunResult that the views read."""

    @property
    def scenario(self) -> str: ...
    @property
    def run(self) -> int | None: ...
    @property
    def seed(self) -> int: ...
    @property
    def channel(self) -> str: ...
    @property
    def passed(self) -> bool: ...
    @property
    def end_reason(self) -> str: ...
    @property
    def exit_code(self) -> int: ...
    @property
    def criteria(self) -> Sequence[Verdict]: ...
    @property
    def metrics(self) -> Mapping[str, float]: ...
    @property
    def parameters(self) -> Mapping[str, str]: ...
    @property
    def warnings(self) -> Sequence[str]: ...
    @property
    def trace_hash(self) -> str: ...
    @property
    def simulated_s(self) -> float: ...
    @property
    def wall_s(self) -> float: ...
    @property
    def settings(self) -> ResolvedSettings: ...


def result_row(result: Result) -> dict[str, Scalar]:
    """Return the columns that `RunResult.to_dict` describes."""
    row: dict[str, Scalar] = {
        "scenario": result.scenario,
        "run": result.run,
        "seed": result.seed,
        "channel": result.channel,
        "passed": bool(result.passed),
        "end_reason": result.end_reason,
        "exit_code": result.exit_code,
        "simulated_s": float(result.simulated_s),
        "wall_s": float(result.wall_s),
        "warnings": len(result.warnings),
        "dt": result.settings.dt,
        "detector": result.settings.detector,
        "planner": result.settings.planner,
        "weather": result.settings.weather,
    }
    row.update((f"parameter.{name}", typed(text)) for name, text in result.parameters.items())
    row.update(_flat("channel", result.settings.channel_profile or {}))
    for verdict in result.criteria:
        row[f"{verdict.name}.passed"] = bool(verdict.passed)
        row[f"{verdict.name}.value"] = None if verdict.value is None else float(verdict.value)
        row[f"{verdict.name}.limit"] = None if verdict.limit is None else float(verdict.limit)
    row.update((name, float(value)) for name, value in result.metrics.items())
    return {**row, "settings_sha256": result.settings.digest, "trace_hash": result.trace_hash}


def typed(text: str) -> Scalar:
    """Return the text of a parameter as a number if it is one; `007` and words remain texts."""
    if _WHOLE.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text) and not re.match(r"[+-]?0\d", text):
        value = float(text)
        return value if math.isfinite(value) else text
    return text


def _flat(name: str, value: Any) -> Iterator[tuple[str, Scalar]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(f"{name}.{key}", item)
    elif isinstance(value, list | tuple):
        yield name, json.dumps(value)
    else:
        yield name, value if isinstance(value, str | int | float | bool) or value is None else str(value)


def result_html(result: Result) -> str:
    """Return the outcome as an HTML fragment: title, table of criteria, end, warnings."""
    word = outcome_word(result)
    color = {"passed": "#1a7f37", "not judged": "#9a6700"}.get(word, "#b42318")
    title = f"{escape(result.scenario)}, seed {result.seed}, channel {escape(result.channel)}"
    rows = "".join(
        f"<tr><td>{escape(verdict.name)}</td><td>{'passed' if verdict.passed else 'failed'}</td>"
        f"<td>{_quantity(verdict.value, verdict.unit)}</td><td>{_quantity(verdict.limit, verdict.unit)}</td>"
        f'<td style="text-align:left">{escape(verdict.reason)}</td></tr>'
        for verdict in result.criteria
    )
    heads = "".join(f"<th>{head}</th>" for head in ("criterion", "", "value", "limit", "reason"))
    table = f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>" if rows else ""
    warnings = "".join(f"<li>{escape(warning)}</li>" for warning in result.warnings)
    mark = escape(result.trace_hash[:12])
    return (
        f'<div><p><b>{title}</b>: <b style="color:{color}">{word}</b></p>{table}'
        f"<p>{escape(result.end_reason)} at {result.simulated_s:.2f} s, trace <code>{mark}</code></p>"
        + (f"<p>warnings:</p><ul>{warnings}</ul>" if warnings else "")
        + "</div>"
    )


def outcome_word(result: Result) -> str:
    """Return `passed`, `not passed`, or `not judged` for a run without criteria."""
    if result.exit_code == NOT_JUDGED:
        return "not judged"
    return "passed" if result.passed else "not passed"


def _quantity(value: float | None, unit: str) -> str:
    return "" if value is None else escape(f"{value:.3f} {unit}" if unit else f"{value:g}")
