"""Settings of the loss models. Each model defines the probability and the reason of a loss."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss

Probability = Annotated[float, Field(ge=0.0, le=1.0)]


class NoLoss(Settings):
    """No loss: every message arrives."""

    kind: Literal["none"] = "none"


class BernoulliLoss(Settings):
    """Independent losses with the same probability for each message.

    scope  `link`: one draw per message and link. `frame`: one draw per receiver and instant applies to all messages
           that are sent to it then, including its own. With `own_perception: true` this is the fault of the published
           EI-Drive code: in one tick a station loses the whole object list or nothing.
    """

    kind: Literal["bernoulli"]
    probability: Probability
    scope: Literal["link", "frame"] = "link"


class GilbertElliottLoss(Settings):
    """Burst losses: a two-state Markov chain (good, bad) with one transition per message of a link.

    (E. N. Gilbert 1960, E. O. Elliott 1963.) Set either the transition probabilities or the resulting burst statistics:

    to_bad, to_good     transition probabilities from good to bad, and back
    probability, burst  stationary share of the bad state, and mean number of consecutive bad messages, which is at
                        least that of independent draws, 1 / (1 - probability)
    good_loss, bad_loss loss probability in each state
    """

    kind: Literal["gilbert_elliott"]
    to_bad: Probability | None = None
    to_good: Probability | None = None
    probability: Annotated[float, Field(ge=0.0, lt=1.0)] | None = None
    burst: Annotated[float, Field(ge=1.0)] | None = None
    good_loss: Probability = 0.0
    bad_loss: Probability = 1.0

    @model_validator(mode="after")
    def _check_alternatives(self) -> GilbertElliottLoss:
        steps, shares = (self.to_bad, self.to_good), (self.probability, self.burst)
        if (None in steps) == (None in shares) or (steps != (None, None) and shares != (None, None)):
            raise ValueError("either to_bad and to_good, or probability and burst are expected")
        if self.burst is not None and self.probability is not None:
            least = 1.0 / (1.0 - self.probability)
            if self.burst < least - 1e-9:
                raise ValueError(f"burst must be at least {least:g} messages with probability {self.probability:g}")
        if sum(self.steps) == 0.0:
            raise ValueError("to_bad or to_good must be above 0")
        return self

    @property
    def steps(self) -> tuple[float, float]:
        """Transition probabilities from good to bad and from bad to good."""
        if self.to_bad is not None and self.to_good is not None:
            return self.to_bad, self.to_good
        assert self.probability is not None
        assert self.burst is not None
        back = 1.0 / self.burst
        return min(1.0, back * self.probability / (1.0 - self.probability)), back

    @property
    def share_bad(self) -> float:
        """Stationary probability of the bad state."""
        to_bad, to_good = self.steps
        return to_bad / (to_bad + to_good)


class DistanceLoss(Settings):
    """Loss by distance between the antennas, from a table with linear interpolation, constant beyond its ends.

    distances  ascending [m]
    reception  packet reception ratio at each distance
    """

    kind: Literal["by_distance"]
    distances: tuple[Annotated[float, Field(ge=0.0)], ...] = Field(min_length=1)
    reception: tuple[Probability, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_table(self) -> DistanceLoss:
        if len(self.distances) != len(self.reception):
            raise ValueError(
                f"reception must have one value per distance (got {len(self.reception)} for {len(self.distances)})"
            )
        if any(second <= first for first, second in pairwise(self.distances)):
            raise ValueError("distances must be ascending")
        return self

    def probability_at(self, distance: float) -> float:
        """Return the loss probability over this distance [m]."""
        return 1.0 - float(np.interp(distance, self.distances, self.reception))


AnyLoss = NoLoss | BernoulliLoss | GilbertElliottLoss | DistanceLoss | Ieee80211pLoss | Cv2xMode4Loss
Loss = Annotated[AnyLoss, Field(discriminator="kind")]
