"""Axes of a sweep: what varies, over which values, and which combinations of them a design runs."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.base.randomness import integer_key
from eidrive_scenario.errors import Diagnostic, InputError, SettingError, quoted
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.openscenario.model import ParameterType
from eidrive_scenario.run_options import OPTIONS, RunSettings
from eidrive_scenario.simulation.result import NUMBER, typed
from eidrive_scenario.v2x.profile import load_profile

Scalar = str | int | float
Point = Mapping[str, Scalar]
"""Values of one combination, by name of the axis."""

MOST_VALUES = 100_000
"""Maximum number of values of a range."""
PARAMETER = "param."
"""Optional prefix of parameters, for those that have the name of a setting."""
CHANNEL = "channel"
RUN = "run"
"""Name of the axis of the runs of a distribution file."""
SETTINGS = {option.name: option for option in OPTIONS if option.form.has_axis}
"""Settings of a run that may vary; all other names are parameters of the scenario."""
DESCRIPTIVE = frozenset({"name", "description"})
"""Settings of a channel profile that have no effect on runs."""
_KINDS = {"delay.seconds": "constant", "loss.probability": "bernoulli"}
"""Kind of a part of a channel that is selected if the part has no such setting: constant delay, independent losses."""
_REPEATED = "a value is given twice"
_RANGE_SIGN = re.compile(r"\s*(?:\.{2,3}|…|:|\bto\b)\s*")
"""Signs of a range, of which only the colon is one here."""


@dataclass(frozen=True)
class Axis:
    """Axis of a sweep.

    name    parameter of the scenario (`param.` may precede it), one of SETTINGS, or `channel.KEY` for a setting of the
            channel profile, such as `channel.delay.seconds`
    values  values of a list or a range; () for an interval
    low, high  limits of an interval, for designs that sample
    is_whole   whether an interval consists of its whole numbers, as for a parameter of an integer type
    texts      values of a list as written
    """

    name: str
    values: tuple[Scalar, ...] = ()
    low: float = math.nan
    high: float = math.nan
    is_whole: bool = False
    texts: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return the axis as in `--vary`, a range as its values."""
        values = map(text_of_value, self.values)
        return f"{self.name}={f'{self.low:g}:{self.high:g}' if self.is_interval else ','.join(self.texts or values)}"

    @property
    def is_interval(self) -> bool:
        """Whether the axis is an interval without single values."""
        return not self.values

    @property
    def ends(self) -> tuple[float, float]:
        """Least and greatest value of an interval."""
        return (math.ceil(self.low), math.floor(self.high)) if self.is_whole else (self.low, self.high)

    def nearest(self, value: float) -> float:
        """Return the value of an interval that is nearest to a number in it."""
        if not self.is_whole:
            return value
        low, high = self.ends
        return int(min(max(round(value), low), high))

    def at(self, share: float) -> Scalar:
        """Return the value at a share in [0, 1): of the interval, or of the list."""
        if self.is_whole:
            low, high = self.ends
            return int(low) + min(int(share * (high - low + 1)), int(high - low))
        if self.is_interval:
            return float(self.low + share * (self.high - self.low))
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]


def parse_axis(text: str, option: str = "--vary") -> Axis:
    """Return the axis of a text: `NAME=A,B,C` (list), `NAME=LOW:HIGH:STEP` (range), or `NAME=LOW:HIGH` (interval).

    A range contains its upper end if a step reaches it. Steps are exact decimals: three steps of 0.1 are 0.3.
    Raise SettingError, which names the option, for other texts, and for numbers with other signs of a range, such as
    `0..1`.
    """
    try:
        return _parsed(text)
    except ValueError as error:
        raise SettingError(Diagnostic(f"{option}: {quoted(text)}", str(error))) from error


def _parsed(text: str) -> Axis:
    """Return the axis of a text. Raise ValueError with the expected form."""
    name, separator, given = text.partition("=")
    name, given = name.strip(), given.strip()
    if not separator or not name or not given:
        raise ValueError("expected NAME=VALUES, such as EgoSpeed=6:12:0.5 or detector=oracle,yolov5")
    parts = given.split(":")
    if len(parts) in (2, 3) and all(NUMBER.fullmatch(part.strip()) for part in parts):
        numbers = [Decimal(part.strip()) for part in parts]
        if not all(math.isfinite(float(number)) and bool(number) == bool(float(number)) for number in numbers):
            raise ValueError("a number is beyond the range of floats")
        return _interval(name, *numbers) if len(parts) == 2 else Axis(name, _range(*numbers))
    texts = [part.strip() for part in given.split(",")]
    if "" in texts:
        raise ValueError("expected a value between commas")
    if any(map(_resembles_range, texts)):
        raise ValueError(f"write a range as {name}=LOW:HIGH:STEP, an interval as {name}=LOW:HIGH")
    if len(set(texts)) < len(texts):
        raise ValueError(_REPEATED)
    return Axis(name, tuple(map(typed, texts)), texts=tuple(texts))


def parse_axes(texts: list[str]) -> tuple[Axis, ...]:
    """Return the axes of several texts. Raise SettingError for an invalid one, or a name that is given twice."""
    axes = tuple(parse_axis(text) for text in texts)
    check_different(axes)
    return axes


def check_different(axes: Sequence[Axis]) -> None:
    """Raise SettingError if two axes have one name."""
    for index, axis in enumerate(axes):
        if axis_identity(axis.name) in [axis_identity(other.name) for other in axes[:index]]:
            raise SettingError(Diagnostic(f"--vary: {axis.name!r}", "the axis is given twice"))


def without_run(point: Point) -> Point:
    """Return a point without the number of a run of a distribution."""
    return {name: value for name, value in point.items() if name != RUN}


def axis_identity(name: str) -> str:
    """Return one name for a parameter with and without prefix, unless a setting has this name."""
    bare = name.removeprefix(PARAMETER)
    return name if is_setting(bare) else bare


def is_setting(name: str) -> bool:
    """Return whether the name of an axis is that of a setting of the run, not of a parameter."""
    return name in SETTINGS or name.startswith(f"{CHANNEL}.")


def _resembles_range(text: str) -> bool:
    """Return whether a text is numbers with signs of a range between them, as in `0..1`, which would be no number."""
    limits = _RANGE_SIGN.split(text)
    return len(limits) > 1 and any(limits) and all(not limit or NUMBER.fullmatch(limit) for limit in limits)


def _interval(name: str, low: Decimal, high: Decimal) -> Axis:
    if low >= high:
        raise ValueError("the upper limit is not above the lower one")
    return Axis(name, low=float(low), high=float(high))


def _range(low: Decimal, high: Decimal, step: Decimal) -> tuple[Scalar, ...]:
    if step == 0 or (high - low) / step < 0:
        raise ValueError("the step does not lead from the first to the last value")
    count = int((high - low) / step) + 1
    if count > MOST_VALUES:
        raise ValueError(f"the range has {count} values (at most {MOST_VALUES})")
    values = [low + number * step for number in range(count)]
    whole = all(value == value.to_integral_value() for value in (low, step))
    return tuple(int(value) if whole else float(value) for value in values)


def settings_at(point: Point, base: RunSettings, profile: Mapping[str, Any] | None) -> RunSettings:
    """Return the settings of a run at a point.

    base     settings of all runs
    profile  channel profile whose settings `channel.KEY` replace unless the point selects a channel: that of the
             option or of the scenario, with all defaults; None for no cooperation

    Raise SettingError for settings of a channel without one.
    """
    parameters = dict(base.parameters)
    fields: dict[str, Any] = {}
    changes: dict[str, Scalar] = {}
    for name, value in point.items():
        if name.startswith(f"{CHANNEL}."):
            changes[name.removeprefix(f"{CHANNEL}.")] = value
        elif name in SETTINGS:
            fields[name] = SETTINGS[name].form.from_axis(name, value)
        else:
            parameters[name.removeprefix(PARAMETER)] = text_of_value(value)
    if changes:
        fields[CHANNEL] = changed_profile(_profile_of(point, profile, changes), changes)
    return replace(base, parameters=parameters, **fields)


def _profile_of(point: Point, profile: Mapping[str, Any] | None, changes: Mapping[str, Scalar]) -> Mapping[str, Any]:
    """Return the profile that a point changes. Raise SettingError if there is none."""
    if CHANNEL in point:
        selected = load_profile(str(point[CHANNEL]))
        profile = None if selected is None else selected.model_dump(mode="json", exclude_unset=True)
    if profile is None:
        message = f"{CHANNEL}.{next(iter(changes))}: the runs have no channel"
        raise SettingError(Diagnostic(message, "select a profile by RunSettings.channel"))
    return profile


def changed_profile(profile: Mapping[str, Any], changes: Mapping[str, Scalar]) -> dict[str, Any]:
    """Return a channel profile with changed settings, given by their paths: `{"delay.seconds": 0.3}`.

    A part without the setting is replaced if there is one kind for it alone: `delay.seconds` then selects a constant
    delay, and `loss.probability` independent losses. The name of the profile is removed.
    """
    changed: dict[str, Any] = {key: value for key, value in profile.items() if key not in DESCRIPTIVE}
    for path, value in sorted(changes.items(), key=lambda change: change[0] not in _KINDS):  # before other settings
        *parts, last = path.split(".")
        inner = changed
        for part in parts:
            held = inner.get(part)
            inner[part] = inner = dict(held) if isinstance(held, Mapping) else {}
        if path in _KINDS and last not in inner:
            inner.clear()
            inner["kind"] = _KINDS[path]
        inner[last] = value
    return changed


def text_of_value(value: Scalar) -> str:
    """Return a value as the text of a parameter; integers and exact decimals as they were given."""
    return value if isinstance(value, str) else repr(value)


_WHOLE = frozenset({ParameterType.INTEGER, ParameterType.INT, ParameterType.UNSIGNED_INT, ParameterType.UNSIGNED_SHORT})
"""Types whose values are whole numbers."""


def with_types(axes: Sequence[Axis], scenario: Path, *, is_distribution: bool = False) -> tuple[Axis, ...]:
    """Return the axes with values of the types of their parameters.

    Intervals of integer types consist of whole numbers. Values of strings are texts as written, unless all are those of
    numbers: `1.10` differs from `1.1`.

    scenario  file of the scenario or of the distribution. Its errors are left to the plan of the sweep

    Raise SettingError for an interval of whole numbers without two of them, and for a list with a value twice.
    """
    types: dict[str, ParameterType] = {}
    if not all(is_setting(axis.name) for axis in axes):
        with suppress(InputError):
            source = load_distribution(scenario).scenario if is_distribution else scenario
            types = load_scenario(source).parameter_types
    return tuple(
        _with_type(axis, None if is_setting(axis.name) else types.get(axis.name.removeprefix(PARAMETER)))
        for axis in axes
    )


def _with_type(axis: Axis, parameter_type: ParameterType | None) -> Axis:
    """Return an axis with values of the type of its parameter, None for another one. Raise as `with_types`."""
    if axis.is_interval and parameter_type in _WHOLE:
        axis = replace(axis, is_whole=True)
        low, high = axis.ends
        if low >= high:
            message = (
                f"--vary: {axis.name} is a whole number, and {axis.low:g}:{axis.high:g} has fewer than two of them"
            )
            raise SettingError(Diagnostic(message, "give a larger interval"))
    written = tuple(map(text_of_value, axis.values))
    if axis.texts and parameter_type is ParameterType.STRING and written != axis.texts:
        axis = replace(axis, values=axis.texts)
    if len(set(axis.values)) < len(axis.values):
        raise SettingError(Diagnostic(f"--vary: {axis.name}={','.join(written)}", _REPEATED))
    return axis


GRID = "grid"
MOST_POINTS = 1_000_000
"""Maximum number of combinations of a sweep."""


DESIGNS = (GRID, "lhs", "sobol")
"""Names of the designs: grid, Latin hypercube, and scrambled Sobol sequence."""


def points_of(axes: Sequence[Axis], design: str, samples: int | None, seed: int) -> list[Point]:
    """Return the combinations of a design; one without axes.

    design   one of DESIGNS. The grid contains all combinations of lists and ranges; the last axis varies fastest
    samples  number of sampled combinations, of which equal ones count once
    seed     seed of the sampling

    Raise SettingError for an unknown design, an interval in a grid, or a number of samples that does not fit.
    """
    if design not in DESIGNS:
        raise SettingError(Diagnostic(f"--design: unknown design {design!r}", f"expected {', '.join(DESIGNS)}"))
    if design == GRID:
        return _grid(axes, samples)
    if not axes:
        raise SettingError(Diagnostic(f"--design {design} without --vary", "give the axes of the design"))
    if samples is None or not 1 <= samples <= MOST_POINTS:
        raise SettingError(
            Diagnostic(
                f"--design {design}: --samples is {'missing' if samples is None else samples}",
                f"expected 1 to {MOST_POINTS} combinations",
            )
        )
    from scipy.stats import qmc

    rng = np.random.default_rng(integer_key(seed, "design", design, size=16))
    if design == "lhs":
        shares = qmc.LatinHypercube(len(axes), rng=rng).random(samples)
    else:
        # The first points of a longer sequence are those of a shorter one, so that more samples add points.
        shares = qmc.Sobol(len(axes), rng=rng).random(1 << max(samples - 1, 0).bit_length())[:samples]
    sampled = (tuple(axis.at(float(share)) for axis, share in zip(axes, row, strict=True)) for row in shares)
    return [{axis.name: value for axis, value in zip(axes, values, strict=True)} for values in dict.fromkeys(sampled)]


def _grid(axes: Sequence[Axis], samples: int | None) -> list[Point]:
    if samples is not None:
        raise SettingError(Diagnostic("--samples has no effect in a grid", "select --design lhs or sobol"))
    for axis in axes:
        if axis.is_interval:
            hint = f"give a step ({axis}:STEP), or --design lhs or sobol"
            raise SettingError(Diagnostic(f"--vary: {axis.name} is an interval in a grid", hint))
    count = math.prod(len(axis.values) for axis in axes)
    if count > MOST_POINTS:
        raise SettingError(Diagnostic(f"the grid has {count} combinations", f"at most {MOST_POINTS} are possible"))
    names = [axis.name for axis in axes]
    return [dict(zip(names, values, strict=True)) for values in product(*(axis.values for axis in axes))]
