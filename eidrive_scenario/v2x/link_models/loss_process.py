"""Decides message by message which is lost, after any of the models of loss."""

from __future__ import annotations

from eidrive_scenario.randomness import generator
from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss
from eidrive_scenario.v2x.link_models.loss import AnyLoss, BernoulliLoss, DistanceLoss, GilbertElliottLoss, NoLoss
from eidrive_scenario.v2x.link_random import LinkRandom
from eidrive_scenario.v2x.messages.message import Message

RENEWAL = 4096
"""After so many messages of a link the chain of Gilbert and Elliott begins anew, in its long-run state: it would take
too long to play it from the first message on for somebody who begins to listen after hours."""


class LossProcess:
    """A message is lost where its draw lies below the probability of loss.

    The draw belongs to the message and the link, whatever the probability is: what arrives with a larger one arrives
    with a smaller one too. That holds for bursts as well, as long as a bad message makes the next bad one likelier.
    """

    def __init__(self, loss: AnyLoss, seed: int) -> None:
        self.loss = loss
        self._seed = seed
        self._draws = LinkRandom(seed)
        self._frames: dict[str, tuple[float, float]] = {}
        self._chains: dict[tuple[str, str], tuple[int, bool]] = {}

    def reason(self, message: Message, receiver: str, now: float, distance: float | None) -> str | None:
        """Why the message is lost on its way to `receiver` over `distance` [m]; None if it is not."""
        loss = self.loss
        if isinstance(loss, NoLoss):
            return None
        if isinstance(loss, BernoulliLoss):
            return "loss" if self._bernoulli(loss, message, receiver, now) < loss.probability else None
        if isinstance(loss, GilbertElliottLoss):
            return self._gilbert_elliott(loss, message, receiver)
        if distance is None:
            raise ValueError(f"the loss {loss.kind!r} needs to know where {message.sender!r} and {receiver!r} are")
        draw = self._draws.uniform("loss", message.sender, receiver, message.number)
        if isinstance(loss, DistanceLoss):
            return "distance" if draw < loss.probability_at(distance) else None
        if isinstance(loss, Ieee80211pLoss | Cv2xMode4Loss):
            return loss.table().cause(distance, draw)
        raise TypeError(f"no loss {loss!r}")

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
        number = max(number, begin - 1)
        while number < message.number:
            number += 1
            likely = loss.share_bad if number == begin else 1.0 - to_good if bad else to_bad
            bad = self._draws.uniform("state", *link, number) < likely
        self._chains[link] = (number, bad)
        probability = loss.bad_loss if bad else loss.good_loss
        if self._draws.uniform("loss", *link, message.number) >= probability:
            return None
        return "burst" if bad else "loss"
