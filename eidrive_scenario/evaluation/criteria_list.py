"""Descriptions of the registered criteria for `eidrive list criteria`."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from eidrive_scenario.errors import EidriveError
from eidrive_scenario.evaluation.criterion import Criterion, CriterionSettings
from eidrive_scenario.registry import registry


def describe_criteria() -> Iterator[tuple[str, str, str, str]]:
    """Yield name, unit, settings with defaults and definition of each criterion.

    The definition of a criterion that does not load is its class and its error.
    """
    known = registry("criteria")
    for name in known:
        try:
            found: type[Criterion] = known.load(name, Criterion)
            yield name, found.unit or "-", _settings(found.settings_type), _definition(found)
        except EidriveError as error:
            yield name, "-", "", f"{known.value(name)}: {str(error).splitlines()[0]}"


def _settings(model: type[CriterionSettings]) -> str:
    """Return the own settings of a criterion; optional ones without a default value have a question mark."""
    shared = CriterionSettings.model_fields
    fields = [(field.alias or name, field) for name, field in model.model_fields.items() if name not in shared]
    return "{" + ", ".join(name + _default(field) for name, field in fields) + "}"


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return ""
    return "?" if field.default is None else f": {str(field.default).lower()}"


def _definition(found: type[Criterion]) -> str:
    """Return the first sentence of the documentation of a class."""
    text = " ".join((inspect.getdoc(found) or "").split("\n\n")[0].split())
    return text.removeprefix("Criterion that ").split(". ")[0].rstrip(".")
