"""One-way delay models. A distribution is given by its quantile function: one uniform number gives one delay.

With common random numbers, a larger mean gives a larger delay of every message, so that the arms of an experiment are
comparable message by message.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, NonNegativeFloat, PositiveFloat, model_validator

from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.link_models.delay_trace import TraceDelay


class ConstantDelay(Settings):
    """Constant delay of every message."""

    kind: Literal["constant"] = "constant"
    seconds: NonNegativeFloat = 0.0

    @property
    def random(self) -> bool:
        return False

    def quantile(self, u: float) -> float:
        """Return the delay [s]."""
        return self.seconds


class _RandomDelay(Settings):
    @property
    def random(self) -> bool:
        return True


class UniformDelay(_RandomDelay):
    """Delay with a uniform distribution between two bounds [s]."""

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


class TruncatedNormalDelay(_RandomDelay):
    """Delay with a truncated normal distribution; `mean` and `sd` refer to the distribution before truncation [s]."""

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
        delay = self.mean + self.sd * float(ndtri(low + u * (high - low)))
        return min(max(delay, self.minimum), math.inf if self.maximum is None else self.maximum)


class ShiftedGammaDelay(_RandomDelay):
    """Delay with a gamma distribution of shape 2 above a minimum; the standard deviation is (mean - minimum) / sqrt 2.

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


class LognormalDelay(_RandomDelay):
    """Delay with a lognormal distribution above a minimum; `mean` and `sd` refer to the part above it [s]."""

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
