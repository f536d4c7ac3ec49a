"""Which messages are lost: each model says with which probability, and for which reason."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss

Probability = Annotated[float, Field(ge=0.0, le=1.0)]


class NoLoss(Settings):
    """Every message arrives."""

    kind: Literal["none"] = "none"


class BernoulliLoss(Settings):
    """Each message is lost with the same probability, independently of all others.

    scope  `link`: one draw per message and link. `frame`: one draw per receiver and instant takes all that is sent to
           it then, over links from others and from itself. With `own_perception: true` this is the fault that the
           published EI-Drive code injects: in one tick a station loses the whole list of objects, or nothing.
    """

    kind: Literal["bernoulli"]
    probability: Probability
    scope: Literal["link", "frame"] = "link"


class GilbertElliottLoss(Settings):
    """Losses in bursts: a chain of two states, good and bad, that takes a step with each message of a link.

    (E. N. Gilbert 1960, E. O. Elliott 1963.) Say either the two steps or what they come to:

    to_bad, to_good     probability of the step from good to bad, and back
    probability, burst  share of bad messages in the long run, and mean number of bad ones in a row; bursts are at
                        least as long as independent draws would make them, 1 / (1 - probability)
    good_loss, bad_loss probability with which a message is lost in either state
    """

    kind: Literal["gilbert_elliott"]
    to_bad: Probability | None = None
    to_good: Probability | None = None
    probability: Annotated[float, Field(ge=0.0, lt=1.0)] | None = None
    burst: Annotated[float, Field(ge=1.0)] | None = None
    good_loss: Probability = 0.0
    bad_loss: Probability = 1.0

    @model_validator(mode="after")
    def _one_way_of_saying_it(self) -> GilbertElliottLoss:
        steps, shares = (self.to_bad, self.to_good), (self.probability, self.burst)
        if (None in steps) == (None in shares) or (steps != (None, None) and shares != (None, None)):
            raise ValueError("give either to_bad and to_good, or probability and burst")
        if self.burst is not None and self.probability is not None:
            least = 1.0 / (1.0 - self.probability)
            if self.burst < least - 1e-9:
                raise ValueError(f"with probability {self.probability:g} a burst is at least {least:g} messages long")
        if sum(self.steps) == 0.0:
            raise ValueError("the chain never moves: to_bad or to_good must be above 0")
        return self

    @property
    def steps(self) -> tuple[float, float]:
        """From good to bad, from bad to good."""
        if self.to_bad is not None and self.to_good is not None:
            return self.to_bad, self.to_good
        assert self.probability is not None
        assert self.burst is not None
        back = 1.0 / self.burst
        return min(1.0, back * self.probability / (1.0 - self.probability)), back

    @property
    def share_bad(self) -> float:
        """Share of messages that meet the bad state in the long run."""
        to_bad, to_good = self.steps
        return to_bad / (to_bad + to_good)

    @property
    def share_lost(self) -> float:
        """Share of messages that are lost in the long run."""
        return self.share_bad * self.bad_loss + (1.0 - self.share_bad) * self.good_loss


class DistanceLoss(Settings):
    """Reception by distance between the antennas, from a table; linear in between, constant beyond its ends.

    distances  [m], rising
    reception  packet reception ratio at each
    """

    kind: Literal["by_distance"]
    distances: tuple[Annotated[float, Field(ge=0.0)], ...] = Field(min_length=1)
    reception: tuple[Probability, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _a_table(self) -> DistanceLoss:
        if len(self.distances) != len(self.reception):
            raise ValueError(f"{len(self.distances)} distances for {len(self.reception)} values of reception")
        if any(second <= first for first, second in pairwise(self.distances)):
            raise ValueError("distances must rise")
        return self

    def probability_at(self, distance: float) -> float:
        """Of a loss over this distance [m]."""
        return 1.0 - float(np.interp(distance, self.distances, self.reception))


AnyLoss = NoLoss | BernoulliLoss | GilbertElliottLoss | DistanceLoss | Ieee80211pLoss | Cv2xMode4Loss
Loss = Annotated[AnyLoss, Field(discriminator="kind")]
