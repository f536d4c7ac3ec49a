"""Settings that a person typed (YAML profiles, controller properties, criterion texts) into checked pydantic models."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from eidrive_scenario.errors import Problem, SettingError, suggestion


class Settings(BaseModel):
    """Base of all typed settings: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


S = TypeVar("S", bound=BaseModel)


def parse_settings(
    model: type[S],
    data: Mapping[str, Any],
    *,
    source: str = "",
    line: int | None = None,
    lines: Mapping[str, int] | None = None,
) -> S:
    """`data` as an instance of `model`.

    `lines` gives the line of single keys where they are known, those inside others as `key_lines` has them. Raises
    SettingError with one Problem per wrong key.
    """
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        problems = []
        for finding in error.errors(include_url=False):
            path = _typed_path(finding["loc"], data)
            place = _line_of(finding["loc"], lines or {}, line)
            if finding["type"] == "extra_forbidden":
                known = _known_keys(model, finding["loc"][:-1])
                message, remedy = f"unknown setting {path!r}", suggestion(str(finding["loc"][-1]), known)
            elif finding["type"] == "missing":
                message, remedy = f"setting {path!r} is missing", "add it"
            elif finding["type"] == "union_tag_invalid":
                word, key = finding["ctx"]["tag"], finding["ctx"]["discriminator"].strip("'")
                message = f"setting {path + '.' + key!r} is {word!r}"
                place = _line_of((*finding["loc"], key), lines or {}, line)
                remedy = suggestion(word, re.findall(r"'([^']*)'", finding["ctx"]["expected_tags"]))
            elif finding["type"] == "union_tag_not_found":
                key = finding["ctx"]["discriminator"].strip("'")
                message = f"setting {path + '.' + key!r} is missing"
                remedy = suggestion("", _tags(model, finding["loc"], key))
            elif finding["type"] in _NO_MAPPING:
                message, remedy = f"setting {path!r} is {finding['input']!r}", "a mapping is expected: {key: value, …}"
            else:
                own = finding["type"] == "value_error"
                remedy = finding["msg"].removeprefix("Value error, ") if own else finding["msg"].lower()
                message = f"setting {path!r} is {finding['input']!r}" if path else "settings do not fit together"
            problems.append(Problem(message, remedy, source, place))
        raise SettingError(problems) from error


_NO_MAPPING = frozenset({"model_type", "model_attributes_type", "dict_type"})


def _typed_path(loc: tuple[int | str, ...], data: Any) -> str:
    """The keys on the way to `loc`, with the kind of what has one: `delay.constant.seconds`. Left out is what pydantic
    adds of its own: the types of a union, and a kind that has given its name to the thing."""
    found: list[str] = []
    for part in loc:
        inside = (
            part in data if isinstance(data, Mapping) else isinstance(data, (list, tuple)) and isinstance(part, int)
        )
        if inside or (isinstance(data, Mapping) and str(part) not in found[-1:]):
            found.append(str(part))
        if inside and (isinstance(data, Mapping) or int(part) < len(data)):
            data = data[part]
    return ".".join(found)


def _line_of(loc: tuple[int | str, ...], lines: Mapping[str, int], line: int | None) -> int | None:
    """The line of the innermost key on the way to `loc` that is known; what pydantic adds of its own is passed over."""
    path = ""
    for part in loc:
        longer = f"{path}.{part}" if path else str(part)
        if longer in lines:
            path, line = longer, lines[longer]
    return line


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """The keys allowed at `path` inside `model`; none where the path leads to one of several models."""
    current = _at(model, path)
    models = [member for member in _members(current) if isinstance(member, type) and issubclass(member, BaseModel)]
    if len(models) == 1:
        current = models[0]
    if isinstance(current, type) and issubclass(current, BaseModel):
        return [name for name, field in current.model_fields.items()] + [
            field.alias for field in current.model_fields.values() if field.alias
        ]
    return []


def _tags(model: type[BaseModel], path: tuple[int | str, ...], key: str) -> list[str]:
    """The words that `key` may have in the union at `path` inside `model`."""
    fields = [getattr(member, "model_fields", {}).get(key) for member in _members(_at(model, path))]
    return [str(word) for field in fields if field is not None for word in get_args(field.annotation)]


def _at(model: type[BaseModel], path: tuple[int | str, ...]) -> Any:
    """The annotation at `path` inside `model`."""
    current: Any = model
    for part in path:
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(str(part))
            current = field.annotation if field is not None else current
        else:
            current = next((member for member in _members(current) if _tagged(member, part)), current)
    return current


def _members(annotation: Any) -> Iterator[Any]:
    """The models in a union, however deep it lies in a mapping or a sequence."""
    for part in get_args(annotation):
        yield part
        yield from _members(part)


def _tagged(member: Any, tag: int | str) -> bool:
    """Whether a member of a tagged union is the one of this tag."""
    fields = getattr(member, "model_fields", {})
    return any(tag in get_args(field.annotation) for field in fields.values())


class _Loader(yaml.SafeLoader):
    """YAML's safe loader, which by itself keeps the last of several equal keys.

    An expression `${…}` is one text, inside braces and brackets too, where YAML takes its brace for a mapping.
    """

    def scan_plain(self) -> yaml.ScalarToken:
        """Scan a scalar without quotes."""
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
        """Number of characters up to its closing brace; 0 if there is none in this line."""
        length = 2
        while self.peek(length) not in "\0\r\n{}":
            length += 1
        return length + 1 if self.peek(length) == "}" else 0

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, "a key is a single word", key.start_mark)
            if key.value in seen:
                raise yaml.constructor.ConstructorError(None, None, f"{key.value!r} stands here twice", key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def load_yaml(text: str, *, source: str, line: int | None = None) -> Any:
    """YAML without object tags; a key that stands twice is a mistake, as one of its values would be lost.

    Raises SettingError with the line of the mistake, counted from `line` if given.
    """
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = (line or 1) + mark.line if mark is not None else line
        what = getattr(error, "problem", None) or str(error)
        raise SettingError(Problem(f"not valid YAML: {what}", "check the syntax there", source, place)) from error
    except ValueError as error:  # what looks like a date and is none
        raise SettingError(Problem(f"not valid YAML: {error}", "put it in quotes", source, line)) from error
    except RecursionError as error:
        raise SettingError(Problem("not valid YAML: nested too deeply", "close the brackets", source, line)) from error


def load_yaml_file(path: Path) -> tuple[Any, dict[str, int]]:
    """A YAML file and the line of each of its keys. Raises SettingError."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingError(Problem(f"cannot read: {error}", "give the path of a YAML file", str(path))) from error
    return load_yaml(text, source=str(path)), key_lines(text)


def key_lines(text: str, first: int = 1) -> dict[str, int]:
    """The line of each key of valid YAML, the first line having the number `first`. Keys inside others have dots, and
    entries of lists numbers: `delay`, `delay.seconds`, `limits.0`."""
    lines: dict[str, int] = {}
    waiting = [("", yaml.compose(text, Loader=_Loader))]
    seen: set[int] = set()
    while waiting:
        path, node = waiting.pop()
        if id(node) in seen:
            continue  # an alias
        seen.add(id(node))
        entries: list[tuple[str, yaml.Node, yaml.Node]] = []
        if isinstance(node, yaml.MappingNode):
            entries = [(str(key.value), key, value) for key, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            entries = [(str(place), value, value) for place, value in enumerate(node.value)]
        for name, where, value in entries:
            inner = f"{path}.{name}" if path else name
            lines[inner] = first + where.start_mark.line
            waiting.append((inner, value))
    return lines
