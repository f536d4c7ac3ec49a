"""Resolved settings as text for pages and for comparisons of runs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from eidrive_scenario.run_options import OPTIONS, RunOption

_MAX_DEPTH = 12
_FRACTION = re.compile(r"[+-]?(0|[1-9]\d*)?\.\d+([eE][+-]?\d+)?", re.ASCII)
_MAX_LENGTH = 2000
"""Maximum number of displayed characters of a value."""
_MOST_VALUES = 8
"""Maximum number of displayed values of a setting that varies; of more numbers, the range is shown."""
_ABSENT = "absent"
_SHOWN_APART = {"channel", "parameters"} | {option.name for option in OPTIONS if option.detail == "stations"}
"""Options of which a page lists more than their value: the content of the channel, stations, parameters."""


def flow_text(value: Any, depth: int = 0) -> str:
    """Return a value in the flow style of YAML: `{delay: {kind: constant, seconds: 0.2}}`."""
    if depth > _MAX_DEPTH:
        return "…"
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key}: {flow_text(item, depth + 1)}" for key, item in value.items())
        return f"{{{inside}}}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(flow_text(item, depth + 1) for item in value) + "]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) and f"{value:g}" == repr(value).removesuffix(".0") else str(value)


def shorten(text: str, max_length: int = _MAX_LENGTH) -> str:
    """Return the text, truncated to a maximum length."""
    return text if len(text) <= max_length else text[: max_length - 1] + "…"


def flatten(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the value of each setting as text, by its path such as `stations.Ego.detector`."""
    return dict(_flatten("", settings, 0))


def _flatten(path: str, value: Any, depth: int) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value and depth < _MAX_DEPTH:
        for key, item in value.items():
            yield from _flatten(f"{path}.{key}" if path else str(key), item, depth + 1)
    else:
        yield path, flow_text(value)


def channel_text(*settings: Mapping[str, Any]) -> str:
    """Return the content of the initial channel of runs without its description; empty without a channel.

    A value in which the channels differ is `varies: 0.1, 0.2`.
    """
    profiles = [profile for of_run in settings if isinstance(profile := of_run.get("channel_profile"), Mapping)]
    hidden = ("name", "description")
    shown = [{key: item for key, item in profile.items() if key not in hidden} for profile in profiles]
    return shorten(flow_text(_common(shown))) if shown else ""


def _common(values: Sequence[Any], depth: int = 0) -> Any:
    """Return the value of several runs; in place of different values, at any depth of mappings, their list as text."""
    if all(value == values[0] for value in values[1:]):
        return values[0]
    if depth < _MAX_DEPTH and all(isinstance(value, Mapping) for value in values):
        keys = dict.fromkeys(key for value in values for key in value)
        return {key: _common([value.get(key, _ABSENT) for value in values], depth + 1) for key in keys}
    numbers = {value for value in values if isinstance(value, int | float) and not isinstance(value, bool)}
    texts = [flow_text(number) for number in sorted(numbers)]
    if len(texts) > _MOST_VALUES:
        texts = [f"{texts[0]} … {texts[-1]} ({len(texts)} values)"]
    others = [flow_text(value) for value in values if isinstance(value, bool) or not isinstance(value, int | float)]
    texts += dict.fromkeys(others)
    return "varies: " + ", ".join(texts[:_MOST_VALUES]) + ", …" * (len(texts) > _MOST_VALUES)


def run_facts(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings that a page lists, by title; parameters with a dollar sign as in scenarios."""
    facts: dict[str, str] = {}
    for key in ("scenario", "run", "seed", "channel"):
        if settings.get(key) is not None:
            facts[key] = shorten(flow_text(settings[key]))
    if content := channel_text(settings):
        facts["channel content"] = content
    for name, station in _entries(settings.get("stations")):
        if isinstance(station, Mapping):
            facts[f"detector of {name}"] = flow_text(station.get("detector"))
            if station.get("detector_settings"):
                facts[f"detector settings of {name}"] = shorten(flow_text(station["detector_settings"]))
            senders = station.get("cooperates_with")
            facts[f"{name} receives from"] = "all" if senders is None else ", ".join(map(str, senders)) or "none"
    for option in OPTIONS:
        if option.in_result and option.name not in _SHOWN_APART and option.name in settings:
            facts |= _option_facts(option, settings[option.name])
    strings = given if isinstance(given := settings.get("strings"), list) else ()
    for name, value in _entries(settings.get("parameters")):
        facts[f"${name}"] = shorten(str(value) if name in strings else short_number(str(value)))
    for key in ("versions", "extensions"):
        for name, value in _entries(settings.get(key)):
            facts[str(name)] = shorten(flow_text(value))
    return facts


def _option_facts(option: RunOption, value: Any) -> dict[str, str]:
    """Return the facts about an option: one for each name of a mapping; none for an option without a value."""
    title = option.name.replace("_", " ")
    if isinstance(value, Mapping):
        return {f"{title.removesuffix('s')} {name}": shorten(flow_text(item)) for name, item in value.items()}
    if value in (None, "", [], ()):
        return {title: option.unset} if option.unset else {}
    return {title: shorten(f"{flow_text(value)} {option.form.unit}".rstrip())}


def _entries(value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        yield from value.items()


def short_number(text: str) -> str:
    """Return a decimal fraction with at most six digits, as drawn values have sixteen, or another text unchanged.

    A text such as `007` or `1_0` may be a name, and an integer may be an identifier.
    """
    if not _FRACTION.fullmatch(text):
        return text
    short = f"{float(text):.6g}"
    return short if len(text) > len(short) and "n" not in short else text
