"""Delays of messages on one link, by distributions or from a recorded trace."""

from __future__ import annotations

import csv
import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, NonNegativeFloat, PositiveFloat, model_validator

from eidrive_scenario.errors import quoted, shortened
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.files.bounded import MIB, read_regular_file, reason_of

MAX_BYTES = 32 * MIB
"""Maximum size of a file of measured delays [bytes]."""
UNITS = {"s": 1.0, "ms": 1e-3}
"""Factor from each unit to seconds."""


class TraceDelay(Settings):
    """Measured delays.

    seconds  values [s], as an alternative to `file`
    file     CSV file, relative to the profile
    column   name of the column in the first row of the file, or its index from 0
    unit     unit of the file, `s` or `ms`
    replay   false: drawn from the values, with linear interpolation; true: message n of a link has value n, and the
             trace repeats
    """

    model_config = ConfigDict(
        json_schema_extra={"required": ["kind"], "anyOf": [{"required": ["seconds"]}, {"required": ["file"]}]}
    )

    kind: Literal["trace"]
    seconds: Annotated[tuple[NonNegativeFloat, ...], Field(min_length=1, repr=False)]
    file: Path | None = None
    column: str | int = 0
    unit: Literal["s", "ms"] = "s"
    replay: bool = False

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        if data.get("file") is None:
            idle = [name for name in ("column", "unit") if name in data]
            if idle:
                raise ValueError(f"{idle[0]} requires file and has no effect with seconds")
            return data
        if data.get("seconds") is not None:
            raise ValueError("either seconds or file is expected, not both")
        scale = UNITS.get(str(data.get("unit", "s")), 1.0)
        values = _column(Path(str(data["file"])), data.get("column", 0))
        return {**data, "seconds": [scale * value for value in values]}

    @cached_property
    def _ascending(self) -> list[float]:
        return sorted(self.seconds)

    def quantile(self, u: float) -> float:
        """Return the quantile of the delay at probability `u` [s]."""
        ascending = self._ascending
        rank = u * (len(ascending) - 1)
        below = min(int(rank), len(ascending) - 1)
        above = min(below + 1, len(ascending) - 1)
        return ascending[below] + (rank - below) * (ascending[above] - ascending[below])


def _column(path: Path, column: object) -> list[float]:
    """Return the numbers in a column of a CSV file. A first row of words names the columns.

    Raise ValueError if the file cannot be read, the column is missing, or a value is not a delay.
    """
    name = shortened(str(path), 200)
    if not isinstance(column, str | int) or isinstance(column, bool):
        raise ValueError(f"column is invalid (got {quoted(column)}; expected a name or an index from 0)")
    try:
        text = read_regular_file(path, MAX_BYTES).decode("utf-8-sig")
        reader = csv.reader(text.splitlines(keepends=True))
        rows = [(reader.line_num, row) for row in reader if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = "not UTF-8 text" if isinstance(error, UnicodeDecodeError) else reason_of(error)
        raise ValueError(f"cannot read {name}: {reason}") from error
    if not rows:
        raise ValueError(f"{name} is empty")
    header = [cell.strip() for cell in rows[0][1]]
    if isinstance(column, str):
        if column not in header:
            raise ValueError(f"{name} has no column {quoted(column)} in its first row")
        index = header.index(column)
    else:
        index = column
    if not 0 <= index < len(header):
        raise ValueError(f"{name} has no column {quoted(index)} (expected 0 to {len(header) - 1})")
    body = rows[1:] if isinstance(column, str) or not _is_number(header[index]) else rows
    if not body:
        raise ValueError(f"{name} has no delays")
    values = []
    for number, row in body:
        # The row is not quoted: the path may refer to a file with other, confidential content.
        if index >= len(row) or not _is_number(row[index]) or not math.isfinite(float(row[index])):
            raise ValueError(f"{name}:{number}: column {index} is not a delay")
        if float(row[index]) < 0.0:
            raise ValueError(f"{name}:{number}: delay is negative")
        values.append(float(row[index]))
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


class ConstantDelay(Settings):
    """Constant delay of every message: seconds [s]."""

    kind: Literal["constant"] = "constant"
    seconds: NonNegativeFloat = 0.0

    def quantile(self, u: float) -> float:
        """Return the delay [s]."""
        return self.seconds


class UniformDelay(Settings):
    """Delay with a uniform distribution between two bounds: minimum, maximum [s]."""

    kind: Literal["uniform"]
    minimum: NonNegativeFloat
    maximum: NonNegativeFloat

    @model_validator(mode="after")
    def _check_order(self) -> UniformDelay:
        if self.maximum < self.minimum:
            raise ValueError(f"maximum must be at least minimum (got {self.maximum:g}, below {self.minimum:g})")
        return self

    def quantile(self, u: float) -> float:
        """Return the quantile of the delay at probability `u` [s]."""
        return self.minimum + u * (self.maximum - self.minimum)


class TruncatedNormalDelay(Settings):
    """Delay with a truncated normal distribution: mean, sd [s] before truncation to minimum, maximum [s]."""

    kind: Literal["truncated_normal"]
    mean: float
    sd: PositiveFloat
    minimum: NonNegativeFloat = 0.0
    maximum: PositiveFloat | None = None

    @model_validator(mode="after")
    def _check_mass(self) -> TruncatedNormalDelay:
        low, high = self._mass
        if high - low < 1e-12:
            raise ValueError(
                f"minimum and maximum must enclose part of the distribution (got mean {self.mean:g}, sd {self.sd:g})"
            )
        return self

    @property
    def _mass(self) -> tuple[float, float]:
        from scipy.special import ndtr

        low = float(ndtr((self.minimum - self.mean) / self.sd))
        high = 1.0 if self.maximum is None else float(ndtr((self.maximum - self.mean) / self.sd))
        return low, high

    def quantile(self, u: float) -> float:
        """Return the quantile of the delay at probability `u` [s]."""

        from scipy.special import ndtri

        low, high = self._mass
        probability = min(low + u * (high - low), math.nextafter(1.0, 0.0))  # far in the tail it rounds to 1
        delay = self.mean + self.sd * float(ndtri(probability))
        return min(max(delay, self.minimum), math.inf if self.maximum is None else self.maximum)


class ShiftedGammaDelay(Settings):
    """Delay with a gamma distribution of shape 2: minimum, mean [s]; standard deviation (mean - minimum) / sqrt 2.

    Eclipse MOSAIC fits this shape to measured vehicular links (GammaRandomDelay).
    """

    kind: Literal["shifted_gamma"]
    minimum: NonNegativeFloat
    mean: NonNegativeFloat

    @model_validator(mode="after")
    def _check_order(self) -> ShiftedGammaDelay:
        if self.mean < self.minimum:
            raise ValueError(f"mean must be at least minimum (got {self.mean:g}, below {self.minimum:g})")
        return self

    def quantile(self, u: float) -> float:
        """Return the quantile of the delay at probability `u` [s]."""

        from scipy.special import gammaincinv

        return self.minimum + (self.mean - self.minimum) / 2.0 * float(gammaincinv(2.0, u))


class LognormalDelay(Settings):
    """Delay with a lognormal distribution above a minimum [s]; mean, sd [s] refer to the part above it."""

    kind: Literal["lognormal"]
    mean: Annotated[float, Field(ge=1e-9, le=1e6)]
    sd: Annotated[float, Field(gt=0.0, le=1e6)]
    minimum: NonNegativeFloat = 0.0

    def quantile(self, u: float) -> float:
        """Return the quantile of the delay at probability `u` [s]."""

        from scipy.special import ndtri

        variance = math.log1p((self.sd / self.mean) ** 2)
        exponent = math.log(self.mean) - variance / 2.0 + math.sqrt(variance) * float(ndtri(u))
        return self.minimum + math.exp(exponent)


def _with_default_kind(value: Any) -> Any:
    """Return the settings with `kind: constant` if they consist of `seconds` alone."""
    return {"kind": "constant", **value} if isinstance(value, dict) and value.keys() == {"seconds"} else value


Delay = Annotated[
    ConstantDelay | UniformDelay | TruncatedNormalDelay | ShiftedGammaDelay | LognormalDelay | TraceDelay,
    Field(discriminator="kind"),
    BeforeValidator(_with_default_kind),
]
