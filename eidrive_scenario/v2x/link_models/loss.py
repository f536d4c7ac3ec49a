"""Losses of messages on one link, and the process of bursts."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss
from eidrive_scenario.v2x.counter_random import LinkRandom
from eidrive_scenario.v2x.messages.message import Message

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


RENEWAL = 4096
"""Number of messages after which the Gilbert-Elliott chain of a link restarts in its stationary distribution.

It bounds the computing time for a receiver that joins after hours, since the chain is simulated message by message.
"""


class LossProcess:
    """Random losses: a message is lost if its random number is below the loss probability.

    The random number depends only on message and link. A message that arrives with a larger probability also arrives
    with a smaller one. This holds for bursts if a bad message raises the probability of the next bad one.
    """

    def __init__(self, loss: AnyLoss, seed: int) -> None:
        self.loss = loss
        self._seed = seed
        self._draws = LinkRandom(seed)
        self._frames: dict[str, tuple[float, float]] = {}
        self._chains: dict[tuple[str, str], tuple[int, bool]] = {}

    def reason(self, message: Message, receiver: str, now: float, distance: float | None) -> str | None:
        """Return the reason for the loss of a message to `receiver` over `distance` [m]; None if it arrives.

        Raise ValueError if the model requires a distance and it is None.
        """
        loss = self.loss
        if isinstance(loss, NoLoss):
            return None
        if isinstance(loss, BernoulliLoss):
            return "loss" if self._bernoulli(loss, message, receiver, now) < loss.probability else None
        if isinstance(loss, GilbertElliottLoss):
            return self._gilbert_elliott(loss, message, receiver)
        if distance is None:
            stations = f"{message.sender!r} and {receiver!r}"
            raise ValueError(f"loss {loss.kind!r} requires antenna positions of {stations} (got none)")
        draw = self._draws.uniform("loss", message.sender, receiver, message.number)
        if isinstance(loss, DistanceLoss):
            return "distance" if draw < loss.probability_at(distance) else None
        return loss.table().cause(distance, draw)

    def _bernoulli(self, loss: BernoulliLoss, message: Message, receiver: str, now: float) -> float:
        if loss.scope == "link":
            return self._draws.uniform("loss", message.sender, receiver, message.number)
        held = self._frames.get(receiver)
        if held is None or held[0] != now:
            instant = round(now * 1e6)
            held = (now, float(generator(self._seed, "frame loss", receiver, instant).random()))
            self._frames[receiver] = held
        return held[1]

    def _gilbert_elliott(self, loss: GilbertElliottLoss, message: Message, receiver: str) -> str | None:
        link = (message.sender, receiver)
        to_bad, to_good = loss.steps
        begin = message.number - message.number % RENEWAL
        number, bad = self._chains.get(link, (-1, False))
        if not begin <= number <= message.number:
            number = begin - 1
        while number < message.number:
            number += 1
            likely = loss.share_bad if number == begin else 1.0 - to_good if bad else to_bad
            bad = self._draws.uniform("state", *link, number) < likely
        self._chains[link] = (number, bad)
        probability = loss.bad_loss if bad else loss.good_loss
        if self._draws.uniform("loss", *link, message.number) >= probability:
            return None
        return "burst" if bad else "loss"
