"""Result of a run, and its views: JSON, one flat row for a table, and HTML for a notebook."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import NOT_JUDGED, counted
from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.run_options import OPTIONS, with_option_names
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

Scalar = str | int | float | bool | None

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_MOST_DIGITS = 16
"""Maximum number of digits of an integer; longer ones are identifiers."""


@dataclass(frozen=True)
class RunResult:
    """Result of a run."""

    scenario: str
    seed: int
    channel: str
    passed: bool
    """Whether all criteria passed before the time limit; False for a run that no criterion judges."""
    end_reason: str
    """Reason for the end: stop trigger, storyboard complete, criterion: NAME, command: NAME, or time limit."""
    exit_code: int
    criteria: tuple[Verdict, ...]
    metrics: Mapping[str, float]
    trace_hash: str
    simulated_s: float
    wall_s: float
    warnings: tuple[str, ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    """Parameters of the scenario, with the values of the run."""
    run: int | None = None
    """Index among the runs of a parameter value distribution, from 0."""
    links: Mapping[tuple[str, str], LinkStatistics] = field(default_factory=dict)
    """Link statistics, by (sender, receiver)."""
    final_links: tuple[LinkEvent, ...] = ()
    """Message outcomes that became known in the last tick; those before are in `Frame.links`."""
    settings: ResolvedSettings = field(default_factory=ResolvedSettings)
    """All settings that determine the run."""
    final_state: tuple[str, ...] = ()
    """State of the storyboard and last decision of each driven station at the end of the run, as lines of text."""
    command: str = ""
    """Command line that reproduces the run; empty for a scenario without a file, and from `run_file`."""
    folder: Path | None = None
    """Folder of `result.json`; None if it was not written."""
    recording: Path | None = None
    """Recording; None if it was not written."""

    def __str__(self) -> str:
        """Return the outcome in one line."""
        failed = [verdict.name for verdict in self.criteria if not verdict.passed]
        outcome = f"failed by {', '.join(failed)}" if failed else outcome_word(self)
        number = "" if self.run is None else f", run {self.run}"
        warned = f", {counted(len(self.warnings), 'warning')}" if self.warnings else ""
        head = f"{self.scenario}{number}, seed {self.seed}, channel {self.channel}"
        return f"{head}: {outcome} ({self.end_reason} at {self.simulated_s:.2f} s{warned})"

    def _repr_html_(self) -> str:
        """Return the outcome as an HTML fragment for notebooks: title, table of criteria, end, warnings."""
        word = outcome_word(self)
        color = {"passed": "#1a7f37", "not judged": "#9a6700"}.get(word, "#b42318")
        title = f"{escape(self.scenario)}, seed {self.seed}, channel {escape(self.channel)}"
        rows = "".join(
            f"<tr><td>{escape(verdict.name)}</td><td>{'passed' if verdict.passed else 'failed'}</td>"
            f"<td>{escape(quantity_text(verdict.value, verdict.unit))}</td>"
            f"<td>{escape(quantity_text(verdict.limit, verdict.unit))}</td>"
            '<td style="text-align:left">'
            f"{'<br>'.join(map(escape, (verdict.reason, *verdict.violation_state)))}</td></tr>"
            for verdict in self.criteria
        )
        heads = "".join(f"<th>{head}</th>" for head in ("criterion", "", "value", "limit", "reason"))
        table = f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>" if rows else ""
        warnings = "".join(f"<li>{escape(warning)}</li>" for warning in self.warnings)
        mark = escape(self.trace_hash[:12])
        return (
            f'<div><p><b>{title}</b>: <b style="color:{color}">{word}</b></p>{table}'
            f"<p>{escape(self.end_reason)} at {self.simulated_s:.2f} s, trace <code>{mark}</code></p>"
            + (f"<p>warnings:</p><ul>{warnings}</ul>" if warnings else "")
            + "</div>"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result as one flat row: every value is a number, a text, a truth value or None.

        Columns: the outcome; `parameter.NAME`, as a number if the value is one and its type is not string;
        `channel.KEY`, the content of the channel at the start; `NAME.passed`, `.value`, `.limit` of each criterion; the
        metrics by their names, without those that have the name of another column; `warnings`, the number of them.
        `pandas.DataFrame([result.to_dict() for result in results])` is a table of runs.
        """
        row: dict[str, Scalar] = {
            "scenario": self.scenario,
            "run": self.run,
            "seed": self.seed,
            "channel": self.channel,
            "passed": bool(self.passed),
            "end_reason": self.end_reason,
            "exit_code": self.exit_code,
            "simulated_s": float(self.simulated_s),
            "wall_s": float(self.wall_s),
            "warnings": len(self.warnings),
            **{option.name: getattr(self.settings, option.name) for option in OPTIONS if option.in_row},
        }
        values = typed_parameters(self.parameters, self.settings.strings)
        row.update((f"parameter.{name}", value) for name, value in values.items())
        row.update(_flat("channel", self.settings.channel_profile or {}))
        for verdict in self.criteria:
            row[f"{verdict.name}.passed"] = bool(verdict.passed)
            row[f"{verdict.name}.value"] = None if verdict.value is None else float(verdict.value)
            row[f"{verdict.name}.limit"] = None if verdict.limit is None else float(verdict.limit)
        row.update((name, float(value)) for name, value in self.metrics.items() if name not in row)
        return {**row, "settings_sha256": self.settings.digest, "trace_hash": self.trace_hash}

    def as_json(self) -> dict[str, Any]:
        """Return the object that `--json` prints, whose warnings name the options of the command line."""
        return {
            "scenario": self.scenario,
            **({} if self.run is None else {"run": self.run}),
            "parameters": dict(self.parameters),
            "seed": self.seed,
            "channel": self.channel,
            "passed": self.passed,
            "end_reason": self.end_reason,
            "criteria": list(map(verdict_json, self.criteria)),
            "final_state": list(self.final_state),
            "warnings": list(map(with_option_names, self.warnings)),
            "metrics": dict(self.metrics),
            "links": [
                {"sender": sender, "receiver": receiver, **statistics.as_json()}
                for (sender, receiver), statistics in self.links.items()
            ],
            "trace_hash": self.trace_hash,
            "simulated_s": self.simulated_s,
            "wall_s": self.wall_s,
            "settings": self.settings.as_json(),
            "settings_sha256": self.settings.digest,
            "command": self.command,
        }


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """Return the object of a verdict that `--json` prints."""
    keys = ("name", "passed", "value", "limit", "unit", "reason", "first_violation")
    return {**{key: getattr(verdict, key) for key in keys}, "violation_state": list(verdict.violation_state)}


def typed(text: str) -> str | int | float:
    """Return the text of a parameter as a number if it can be written as one again; `007` and words remain texts."""
    if not NUMBER.fullmatch(text) or re.match(r"[+-]?0\d", text):
        return text
    digits = text.lstrip("+-")
    if digits.isdecimal():
        return int(text) if len(digits) <= _MOST_DIGITS else text
    value = float(text)
    return value if math.isfinite(value) else text


def typed_parameters(parameters: Mapping[str, str], strings: Collection[str]) -> dict[str, str | int | float]:
    """Return parameters with numbers as such, except for `strings`, whose `1.10` differs from `1.1`."""
    return {name: text if name in strings else typed(text) for name, text in parameters.items()}


def _flat(name: str, value: Any) -> Iterator[tuple[str, Scalar]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(f"{name}.{key}", item)
    elif isinstance(value, list | tuple):
        yield name, json.dumps(value)
    else:
        yield name, value if isinstance(value, str | int | float | bool) or value is None else str(value)


def outcome_word(result: RunResult) -> str:
    """Return `passed`, `failed` by a criterion, `not passed` by a time limit, or `not judged` without criteria."""
    if result.exit_code == NOT_JUDGED:
        return "not judged"
    if not all(verdict.passed for verdict in result.criteria):
        return "failed"
    return "passed" if result.passed else "not passed"


def quantity_text(value: float | None, unit: str) -> str:
    """Return the value or limit of a criterion as text; empty for None."""
    return "" if value is None else f"{value:.3f} {unit}" if unit else f"{value:g}"
