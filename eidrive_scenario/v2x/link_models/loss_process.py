"""Random losses of messages by any of the loss models."""

from __future__ import annotations

from eidrive_scenario.randomness import generator
from eidrive_scenario.v2x.link_models.loss import AnyLoss, BernoulliLoss, DistanceLoss, GilbertElliottLoss, NoLoss
from eidrive_scenario.v2x.link_random import LinkRandom
from eidrive_scenario.v2x.messages.message import Message

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
