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

    `lines` gives the line of single keys where they are known. Raises SettingError with one Problem per wrong key.
    """
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        problems = []
        for finding in error.errors(include_url=False):
            path = ".".join(str(part) for part in finding["loc"])
            place = (lines or {}).get(str(finding["loc"][0]) if finding["loc"] else "", line)
            if finding["type"] == "extra_forbidden":
                known = _known_keys(model, finding["loc"][:-1])
                message, remedy = f"unknown setting {path!r}", suggestion(str(finding["loc"][-1]), known)
            elif finding["type"] == "missing":
                message, remedy = f"setting {path!r} is missing", "add it"
            elif finding["type"] == "union_tag_invalid":
                word, key = finding["ctx"]["tag"], finding["ctx"]["discriminator"].strip("'")
                message = f"setting {path + '.' + key!r} is {word!r}"
                remedy = suggestion(word, re.findall(r"'([^']*)'", finding["ctx"]["expected_tags"]))
            else:
                own = finding["type"] == "value_error"
                remedy = finding["msg"].removeprefix("Value error, ") if own else finding["msg"].lower()
                message = f"setting {path!r} is {finding['input']!r}"
            problems.append(Problem(message, remedy, source, place))
        raise SettingError(problems) from error


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """The keys allowed at `path` inside `model`; none where the path leads to one of several models."""
    current: Any = model
    for part in path:
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(str(part))
            current = field.annotation if field is not None else current
        else:
            current = next((member for member in _members(current) if _tagged(member, part)), current)
    models = [member for member in _members(current) if isinstance(member, type) and issubclass(member, BaseModel)]
    if len(models) == 1:
        current = models[0]
    if isinstance(current, type) and issubclass(current, BaseModel):
        return [name for name, field in current.model_fields.items()] + [
            field.alias for field in current.model_fields.values() if field.alias
        ]
    return []


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
    """YAML's safe loader, which by itself keeps the last of several equal keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key, _ in node.value:
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


def load_yaml_file(path: Path) -> tuple[Any, dict[str, int]]:
    """A YAML file and the line of each of its top-level keys. Raises SettingError."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingError(Problem(f"cannot read: {error}", "give the path of a YAML file", str(path))) from error
    data = load_yaml(text, source=str(path))
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    lines = {}
    if isinstance(node, yaml.MappingNode):
        lines = {str(key.value): key.start_mark.line + 1 for key, _ in node.value}
    return data, lines
