"""One-way delays: a distribution is its quantile function, so that one uniform draw gives one delay.

With the draw fixed, a larger mean gives a larger delay of every single message: arms of an experiment stay comparable
message by message (common random numbers).
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, NonNegativeFloat, PositiveFloat, model_validator
from scipy.special import gammaincinv, ndtr, ndtri

from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.link_models.delay_trace import TraceDelay


class ConstantDelay(Settings):
    """Every message takes the same time."""

    kind: Literal["constant"] = "constant"
    seconds: NonNegativeFloat = 0.0

    @property
    def random(self) -> bool:
        return False

    def quantile(self, u: float) -> float:
        """The delay [s]."""
        return self.seconds


class _RandomDelay(Settings):
    @property
    def random(self) -> bool:
        return True


class UniformDelay(_RandomDelay):
    """Evenly spread between two bounds [s]."""

    kind: Literal["uniform"]
    minimum: NonNegativeFloat
    maximum: NonNegativeFloat

    @model_validator(mode="after")
    def _ordered(self) -> UniformDelay:
        if self.maximum < self.minimum:
            raise ValueError(f"maximum {self.maximum:g} lies below minimum {self.minimum:g}")
        return self

    def quantile(self, u: float) -> float:
        """The delay that a share `u` of all messages does not exceed [s]."""
        return self.minimum + u * (self.maximum - self.minimum)


class TruncatedNormalDelay(_RandomDelay):
    """A normal distribution cut off at two bounds; `mean` and `sd` are those before the cut [s]."""

    kind: Literal["truncated_normal"]
    mean: float
    sd: PositiveFloat
    minimum: NonNegativeFloat = 0.0
    maximum: PositiveFloat | None = None

    @model_validator(mode="after")
    def _some_mass_between_the_bounds(self) -> TruncatedNormalDelay:
        low, high = self._mass
        if high - low < 1e-12:
            raise ValueError(f"no delay of mean {self.mean:g}, sd {self.sd:g} falls between minimum and maximum")
        return self

    @property
    def _mass(self) -> tuple[float, float]:
        low = float(ndtr((self.minimum - self.mean) / self.sd))
        high = 1.0 if self.maximum is None else float(ndtr((self.maximum - self.mean) / self.sd))
        return low, high

    def quantile(self, u: float) -> float:
        """The delay that a share `u` of all messages does not exceed [s]."""
        low, high = self._mass
        delay = self.mean + self.sd * float(ndtri(low + u * (high - low)))
        return min(max(delay, self.minimum), math.inf if self.maximum is None else self.maximum)


class ShiftedGammaDelay(_RandomDelay):
    """A least delay and a gamma tail of shape 2 above it; the standard deviation is (mean - minimum) / sqrt 2 [s].

    The shape that Eclipse MOSAIC fits to measured vehicular links (GammaRandomDelay).
    """

    kind: Literal["shifted_gamma"]
    minimum: NonNegativeFloat
    mean: NonNegativeFloat

    @model_validator(mode="after")
    def _ordered(self) -> ShiftedGammaDelay:
        if self.mean < self.minimum:
            raise ValueError(f"mean {self.mean:g} lies below minimum {self.minimum:g}")
        return self

    def quantile(self, u: float) -> float:
        """The delay that a share `u` of all messages does not exceed [s]."""
        return self.minimum + (self.mean - self.minimum) / 2.0 * float(gammaincinv(2.0, u))


class LognormalDelay(_RandomDelay):
    """A lognormal delay above an offset; `mean` and `sd` are those of the part above it [s]."""

    kind: Literal["lognormal"]
    mean: Annotated[float, Field(ge=1e-9, le=1e6)]
    sd: Annotated[float, Field(gt=0.0, le=1e6)]
    minimum: NonNegativeFloat = 0.0

    def quantile(self, u: float) -> float:
        """The delay that a share `u` of all messages does not exceed [s]."""
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
