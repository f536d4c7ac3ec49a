"""Settings that a caller gives as YAML text, as a YAML file, or in Python as a mapping."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.files.similar_paths import file_suggestion
from eidrive_scenario.files.yaml_text import MAX_DEPTH, load_yaml, load_yaml_file

_INLINE = ("{", "[", "\n", ": ")
"""Parts of a text that is YAML itself, not the path of a file."""


@dataclass(frozen=True)
class YamlContent:
    """Parsed content, its file or option, and the lines of its keys as returned by `key_lines`; none for a text."""

    data: Any
    source: str
    lines: Mapping[str, int] = field(default_factory=dict)


_FLOW: dict[str, Any] = {"default_flow_style": True, "sort_keys": False, "allow_unicode": True}


class _PlainDumper(yaml.SafeDumper):
    """Dumper that repeats a value instead of writing an alias, which `load_yaml` rejects."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def is_inline(text: str) -> bool:
    """Whether a text is YAML itself; other texts are paths of files."""
    return any(part in text for part in _INLINE)


def read_yaml_source(source: str | Path, *, option: str) -> YamlContent:
    """Return the content of a YAML text, or of the YAML file at a path.

    option  name of the setting in messages about a text

    Raise SettingError with file and line if it cannot be read or is not valid YAML.
    """
    if isinstance(source, str) and is_inline(source):
        return YamlContent(load_yaml(source, source=option), option)
    path = Path(source)
    if not is_regular_file(path):
        message = f"no file {quoted(str(source))}"
        otherwise = "give the path of a YAML file, or a mapping {key: value}"
        hint = file_suggestion(path, (".yaml", ".yml"), otherwise=otherwise)
        raise SettingError(Diagnostic(message, hint, option))
    data, lines = load_yaml_file(path)
    return YamlContent(data, str(path), lines)


def flow_yaml(value: Any, *, setting: str) -> str:
    """Return a value of Python as YAML in one line, which `load_yaml` reads as an equal value.

    Tuples become lists, paths become texts. Raise SettingError for values that YAML lacks.
    """
    try:
        plain = _plain(value)
        text: str = yaml.dump(plain, Dumper=_PlainDumper, width=np.inf, **_FLOW)
    except (yaml.YAMLError, ValueError) as error:
        message = f"{setting} is {quoted(value)}, which is not YAML: {quoted(str(error))}"
        raise SettingError(Diagnostic(message, "give numbers, texts, truth values, lists and mappings")) from error
    return text.removesuffix("...\n").strip()  # PyYAML marks the end of a single word


def _plain(value: Any, depth: int = 0) -> Any:
    if depth > MAX_DEPTH:
        raise ValueError("nested too deeply")
    if isinstance(value, Mapping):
        return {_plain(key, depth + 1): _plain(item, depth + 1) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, depth + 1) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), depth)
    return os.fspath(value) if isinstance(value, os.PathLike) else value
