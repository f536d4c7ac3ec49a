"""Inputs of a run from outside the scenario: poses of entities, and user-defined values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple, Never

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario.model import Element
from eidrive_scenario.roads import Pose

NONE: Mapping[str, Never] = MappingProxyType({})
"""No inputs from outside."""


class ExternalPose(NamedTuple):
    """Pose of an entity at the end of the step, and its speed along its heading [m/s]."""

    pose: Pose
    speed: float


def user_value_warnings(
    requested: Mapping[str, Element], given: Collection[str], settings: Collection[str]
) -> Iterator[str]:
    """Yield a warning for each requested value without a setting, and for each setting that no condition reads.

    requested  first element that requests each value, by the name of the value
    given      names of the values that are set in the run
    settings   names of the values that the settings of the run set
    """
    for name, element in requested.items():
        if name not in given:
            where = f"{element.source}:{element.line}"
            effect = f"UserDefinedValueCondition {name!r} is never fulfilled: no value is set"
            yield f"{where}: {effect}; use --user-value {name}=VALUE or set_user_value"
    for name in settings:
        if name not in requested:
            yield f"--user-value {name}: no UserDefinedValueCondition reads the value; {suggestion(name, requested)}"
