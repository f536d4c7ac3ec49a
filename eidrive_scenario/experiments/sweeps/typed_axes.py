"""Types of the parameters that the axes of a sweep vary."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, InputError, SettingError
from eidrive_scenario.experiments.sweeps.axes import PARAMETER, Axis, is_setting
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.openscenario.model import ParameterType

_WHOLE = frozenset({ParameterType.INTEGER, ParameterType.INT, ParameterType.UNSIGNED_INT, ParameterType.UNSIGNED_SHORT})
"""Types whose values are whole numbers."""


def with_types(axes: Sequence[Axis], scenario: Path, *, is_distribution: bool = False) -> tuple[Axis, ...]:
    """Return the axes, of which intervals of parameters with an integer type consist of whole numbers.

    scenario  file of the scenario or of the distribution. Its errors are left to the plan of the sweep

    Raise SettingError for such an interval without a whole number.
    """
    if not any(axis.is_interval and not is_setting(axis.name) for axis in axes):
        return tuple(axes)
    names: set[str] = set()
    with suppress(InputError):
        source = load_distribution(scenario).scenario if is_distribution else scenario
        declared = load_scenario(source).document.parameter_declarations
        if declared is not None:
            names = {one.name for one in declared.parameter_declaration if one.parameter_type in _WHOLE}
    return tuple(_typed(axis, names) for axis in axes)


def _typed(axis: Axis, names: set[str]) -> Axis:
    if not axis.is_interval or is_setting(axis.name) or axis.name.removeprefix(PARAMETER) not in names:
        return axis
    typed = replace(axis, is_whole=True)
    low, high = typed.ends
    if low >= high:
        message = f"--vary: {axis.name} is a whole number, and {axis.low:g}:{axis.high:g} has fewer than two of them"
        raise SettingError(Diagnostic(message, "give a larger interval"))
    return typed
