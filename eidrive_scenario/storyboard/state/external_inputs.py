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
    """Yield a warning for each value that a condition requests in vain, and for each setting that none requests.

    requested  the element that requested each value first, by the name of the value
    given      names of the values that the run has;  settings  names of those that its settings gave
    """
    for name, by in requested.items():
        if name not in given:
            where = f"{by.source}:{by.line}"
            yield f"{where}: nobody gave the user-defined value {name!r}; use --user-value or set_user_value"
    for name in settings:
        if name not in requested:
            yield f"no UserDefinedValueCondition asks for {name!r}; {suggestion(name, requested)}"
