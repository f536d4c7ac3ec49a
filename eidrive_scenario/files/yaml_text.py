"""YAML from untrusted sources: no object tags, aliases or merge keys, bounded in size and depth, lines of keys."""

from __future__ import annotations

import os
import re
from collections.abc import Hashable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NoReturn

import numpy as np
import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.resolver import Resolver
from yaml.scanner import Scanner

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.files.bounded import is_regular_file, read_regular_file, reason_of
from eidrive_scenario.files.similar_paths import file_suggestion

MAX_YAML = 2**17
"""Maximum number of characters of a YAML text."""
MAX_DEPTH = 20
"""Maximum nesting depth of lists and mappings."""
MAX_NODES = 50_000
"""Maximum number of values and keys of a YAML text."""
MAX_DIGITS = 40
"""Maximum number of characters of a number."""

_QUOTED = re.compile(r"'[^']{2,}'|\"[^\"]{2,}\"")
"""Pattern of quoted words in messages of YAML; quoted single characters, such as an expected comma, are not matched."""
_COMMON = re.compile(r"[\w \n.,:;+\-/()\[\]{}'\"#]*", re.ASCII)
"""Texts that both parsers read alike: libyaml accepts tabs, byte order marks and question marks at more places."""
_ALIAS = "anchors and aliases are not supported"
_MERGE = "merge keys are not supported"
_LONG_NUMBER = f"a number has more than {MAX_DIGITS} digits"


class _Loader(Composer, SafeConstructor, Resolver):
    """Safe loader that rejects duplicate keys and aliases, which PyYAML expands without limit. A parser is added."""

    def __init__(self) -> None:
        Composer.__init__(self)
        SafeConstructor.__init__(self)
        Resolver.__init__(self)
        self._depth = 0
        self._count = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node; raise MarkedYAMLError for aliases, which may be recursive, and for exceeded limits."""
        event: Any = self.peek_event()  # type: ignore[attr-defined]
        self._count += 1
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            raise yaml.MarkedYAMLError(problem=_ALIAS, problem_mark=event.start_mark)
        if self._depth >= MAX_DEPTH:
            raise yaml.MarkedYAMLError(problem="nested too deeply", problem_mark=event.start_mark)
        if self._count > MAX_NODES:
            raise yaml.MarkedYAMLError(problem=f"more than {MAX_NODES} values", problem_mark=event.start_mark)
        self._depth += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, "a key is a single word", key.start_mark)
            if key.tag == "tag:yaml.org,2002:merge":
                raise yaml.constructor.ConstructorError(None, None, _MERGE, key.start_mark)
            if key.value in seen:
                raise _duplicate(key)
            seen.add(key.value)
        mapping: dict[Hashable, Any] = super().construct_mapping(node, deep)
        if len(mapping) < len(node.value):  # two spellings of an equal key, such as 1 and 1.0
            keys = [self.construct_object(key) for key, _ in node.value]
            raise _duplicate(next(key for n, (key, _) in enumerate(node.value) if keys[n] in keys[:n]))
        return mapping

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        if len(node.value) > MAX_DIGITS:
            raise yaml.constructor.ConstructorError(None, None, _LONG_NUMBER, node.start_mark)
        return int(super().construct_yaml_int(node))

    def construct_yaml_float(self, node: yaml.ScalarNode) -> float:
        if len(node.value) > MAX_DIGITS:
            raise yaml.constructor.ConstructorError(None, None, _LONG_NUMBER, node.start_mark)
        return float(super().construct_yaml_float(node))

    def construct_undefined(self, node: yaml.Node) -> NoReturn:
        raise yaml.constructor.ConstructorError(None, None, "tags are not supported", node.start_mark)

    yaml_constructors: ClassVar[dict[str | None, Any]] = {
        **SafeConstructor.yaml_constructors,
        "tag:yaml.org,2002:int": construct_yaml_int,
        "tag:yaml.org,2002:float": construct_yaml_float,
        None: construct_undefined,
    }


def _duplicate(key: yaml.ScalarNode) -> yaml.constructor.ConstructorError:
    message = f"duplicate key {quoted(key.value, 100)}"
    return yaml.constructor.ConstructorError(None, None, message, key.start_mark)


class _TextLoader(_Loader, Reader, Scanner, Parser):
    """Loader with the parser in Python.

    An expression `${…}` is a single text inside braces and brackets too, where YAML reads its brace as a mapping.
    """

    def __init__(self, stream: str) -> None:
        Reader.__init__(self, stream)
        Scanner.__init__(self)
        Parser.__init__(self)
        super().__init__()

    def scan_plain(self) -> yaml.ScalarToken:
        """Scan a scalar without quotes; an expression `${…}` is one scalar."""
        if self.flow_level and self.prefix(2) == "${":
            length = self._length_of_expression()
            if length:
                start = self.get_mark()
                text = self.prefix(length)
                self.forward(length)
                self.allow_simple_key = False
                return yaml.ScalarToken(text, False, start, self.get_mark(), "'")
        token: yaml.ScalarToken = super().scan_plain()
        return token

    def _length_of_expression(self) -> int:
        """Return the number of characters up to the closing brace; 0 if there is none in this line."""
        length = 2
        while self.peek(length) not in "\0\r\n{}":
            length += 1
        return length + 1 if self.peek(length) == "}" else 0


if yaml.__with_libyaml__:
    from yaml._yaml import CParser

    class _FastLoader(_Loader, CParser):
        """Loader with the parser of libyaml, which reads a frame of OPV2V four times as fast."""

        def __init__(self, stream: str) -> None:
            CParser.__init__(self, stream)
            super().__init__()


def load_yaml(text: str, *, source: str, line: int | None = None) -> Any:
    """Load YAML without object tags, aliases and merge keys, of bounded size and depth.

    A duplicate key is an error, as one of its values would be lost. Raise SettingError with the line of the error,
    counted from `line` if given.
    """
    return load_yaml_text(text, source=source, line=line)[0]


def _load(text: str, source: str, line: int | None, quote: bool) -> tuple[Any, dict[str, int]]:
    """Return the data of a text as `load_yaml`, and the line of each key, from 0.

    quote  whether messages may quote words of the text; False for files, which may be of another kind
    """
    if len(text) > MAX_YAML:
        diagnostic = Diagnostic(f"not valid YAML: more than {MAX_YAML} characters", "shorten it", source, line)
        raise SettingError(diagnostic)
    try:
        return _parse(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        error_line = (line or 1) + min(mark.line, text.count("\n")) if mark is not None else line
        reason = getattr(error, "problem", None) or "a character is not allowed"
        reason = reason if quote else _QUOTED.sub("…", reason)
        hint = "repeat the value at each use" if reason in (_ALIAS, _MERGE) else "check the syntax in this line"
        raise SettingError(Diagnostic(f"not valid YAML: {reason}", hint, source, error_line)) from error
    except (ValueError, ArithmeticError) as error:  # invalid text in the form of a date or a number
        message = f"not valid YAML: {_QUOTED.sub('…', str(error))}"
        raise SettingError(Diagnostic(message, "put it in quotes", source, line)) from error


def load_yaml_file(path: Path, hint: str = "give the path of a YAML file") -> tuple[Any, dict[str, int]]:
    """Return the content of a YAML file and the line of each of its keys. Raise SettingError if it is invalid.

    hint  of the error for a file that cannot be read
    """
    try:
        text = read_regular_file(path, 4 * MAX_YAML).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = "the file is not text in UTF-8" if isinstance(error, UnicodeDecodeError) else reason_of(error)
        raise SettingError(Diagnostic(f"cannot read: {reason}", hint, str(path))) from error
    data, lines = _load(text, str(path), None, quote=False)
    return data, {key: line + 1 for key, line in lines.items()}


def load_yaml_text(text: str, *, source: str, line: int | None = None) -> tuple[Any, dict[str, int]]:
    """Return the data of a text and the line of each key, counted from `line` if given. Raise as `load_yaml`.

    Nested keys are joined by dots, and entries of lists are numbered: `delay`, `delay.seconds`, `limits.0`.
    """
    data, lines = _load(text, source, line, quote=True)
    return data, {key: (line or 1) + below for key, below in lines.items()}


def load_mapping(
    text: str, name: str, hint: str, *, source: str, line: int | None
) -> tuple[dict[Any, Any], dict[str, int]]:
    """Return the mapping in the text of `name`, and the line of each key as `load_yaml_text`.

    Raise SettingError as `load_yaml`, or with this hint if the text is no mapping.
    """
    data, lines = load_yaml_text(text, source=source, line=line)
    if not isinstance(data, dict):
        raise SettingError(Diagnostic(f"{name} is {quoted(data)}", hint, source, line))
    return data, lines


def _parse(text: str) -> tuple[Any, dict[str, int]]:
    """Return the data of a text, and the line of each key, from 0."""
    if yaml.__with_libyaml__ and _COMMON.fullmatch(text):
        with suppress(yaml.YAMLError, ValueError):  # the other parser describes the error
            return _loaded(_FastLoader(text))
    return _loaded(_TextLoader(text))


def _loaded(loader: _Loader) -> tuple[Any, dict[str, int]]:
    node = loader.get_single_node()
    data = None if node is None else loader.construct_document(node)
    return data, _lines_of(node)


def _lines_of(root: yaml.Node | None) -> dict[str, int]:
    lines: dict[str, int] = {}
    waiting = [("", root)]
    while waiting:
        path, node = waiting.pop()
        entries: list[tuple[str, yaml.Node, yaml.Node]] = []
        if isinstance(node, yaml.MappingNode):
            entries = [(str(key.value), key, value) for key, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            entries = [(str(index), value, value) for index, value in enumerate(node.value)]
        for name, start, value in entries:
            inner = f"{path}.{name}" if path else name
            lines[inner] = start.start_mark.line
            waiting.append((inner, value))
    return lines


_INLINE = ("{", "[", "\n", ": ")
"""Parts of a text that is YAML itself, not the path of a file."""


@dataclass(frozen=True)
class YamlContent:
    """Parsed content, its file or option, and the lines of its keys as of `load_yaml_text`; none for a text."""

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
