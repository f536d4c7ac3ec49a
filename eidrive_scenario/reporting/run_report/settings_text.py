"""Resolved settings as text: lines of a page, and the entries in which runs differ."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

_DEEPEST = 12
_FRACTION = re.compile(r"[+-]?(0|[1-9]\d*)?\.\d+([eE][+-]?\d+)?", re.ASCII)
_LONGEST = 2000
"""Characters of a value that are shown."""


def flow_text(value: Any, depth: int = 0) -> str:
    """A value in the flow style of YAML: `{delay: {kind: constant, seconds: 0.2}}`."""
    if depth > _DEEPEST:
        return "…"
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key}: {flow_text(item, depth + 1)}" for key, item in value.items())
        return f"{{{inside}}}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(flow_text(item, depth + 1) for item in value) + "]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) and f"{value:g}" == repr(value).removesuffix(".0") else str(value)


def shortened(text: str, longest: int = _LONGEST) -> str:
    """The text, cut off where it is longer than a page shows."""
    return text if len(text) <= longest else text[: longest - 1] + "…"


def flattened(settings: Mapping[str, Any]) -> dict[str, str]:
    """Each single setting by its path, as `stations.Ego.detector`, with its value as a text."""
    return dict(_flattened("", settings, 0))


def _flattened(path: str, value: Any, depth: int) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value and depth < _DEEPEST:
        for key, item in value.items():
            yield from _flattened(f"{path}.{key}" if path else str(key), item, depth + 1)
    else:
        yield path, flow_text(value)


def channel_text(settings: Mapping[str, Any]) -> str:
    """The content of the channel at the start, without its description; empty where there is none."""
    profile = settings.get("channel_profile")
    if not isinstance(profile, Mapping):
        return ""
    return shortened(flow_text({key: item for key, item in profile.items() if key not in ("name", "description")}))


def run_facts(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings that a page lists, by title; parameters with a dollar sign, as scenarios refer to them."""
    facts: dict[str, str] = {}
    for key in ("scenario", "run", "seed", "channel"):
        if settings.get(key) is not None:
            facts[key] = shortened(flow_text(settings[key]))
    if content := channel_text(settings):
        facts["channel content"] = content
    for name, station in _entries(settings.get("stations")):
        if isinstance(station, Mapping):
            facts[f"detector of {name}"] = flow_text(station.get("detector"))
            if station.get("detector_settings"):
                facts[f"detector settings of {name}"] = shortened(flow_text(station["detector_settings"]))
            senders = station.get("cooperates_with")
            facts[f"{name} receives from"] = "all" if senders is None else ", ".join(map(str, senders)) or "none"
    if "weather" in settings:
        facts["weather"] = flow_text(settings["weather"] or "of the scenario")
    for key in ("dt", "time_limit"):
        if settings.get(key) is not None:
            facts[key.replace("_", " ")] = f"{flow_text(settings[key])} s"
    for key in ("controllers", "user_values"):
        for name, value in _entries(settings.get(key)):
            facts[f"{key.removesuffix('s').replace('_', ' ')} {name}"] = shortened(flow_text(value))
    for name, value in _entries(settings.get("parameters")):
        facts[f"${name}"] = shortened(short_number(str(value)))
    for key in ("versions", "extensions"):
        for name, value in _entries(settings.get(key)):
            facts[str(name)] = shortened(flow_text(value))
    return facts


def _entries(value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        yield from value.items()


def short_number(text: str) -> str:
    """A decimal fraction with six digits at most, as those that a seed draws have sixteen; other texts as they are.

    A text such as `007` or `1_0` may be a name, and a whole number may identify something.
    """
    if not _FRACTION.fullmatch(text):
        return text
    short = f"{float(text):.6g}"
    return short if len(text) > len(short) and "n" not in short else text
