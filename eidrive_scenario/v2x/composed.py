"""The channel composed of one delay and one loss model, the same on every link."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from eidrive_scenario.randomness import generator
from eidrive_scenario.v2x.delay import ConstantDelay, Delay
from eidrive_scenario.v2x.draws import LinkDraws
from eidrive_scenario.v2x.link_channel import LinkChannel
from eidrive_scenario.v2x.loss import BernoulliLoss, Loss, NoLoss
from eidrive_scenario.v2x.message import Message
from eidrive_scenario.v2x.profile import ChannelProfile


class ComposedProfile(ChannelProfile):
    """Delay and loss of every link.

    reordering  true: a message may overtake an earlier one of its link, so that delays are those drawn; false: it
                waits until the earlier ones have arrived
    """

    model: Literal["composed"] = "composed"
    delay: Delay = ConstantDelay()
    loss: Loss = NoLoss()
    reordering: bool = True


class ComposedChannel(LinkChannel):
    """A message is lost where its draw lies below the loss probability p, and else delayed by another draw's quantile.

    Both draws belong to the message and the link, whatever p is: what arrives with a larger p arrives with a smaller
    one too.
    """

    settings: ClassVar[type[ChannelProfile]] = ComposedProfile

    def __init__(self, profile: ComposedProfile, seed: int) -> None:
        super().__init__()
        self.profile = profile
        self.own_perception = profile.own_perception
        self._seed = seed
        self._draws = LinkDraws(seed)
        self._last_arrival: dict[tuple[str, str], float] = {}
        self._frames: dict[str, tuple[float, float]] = {}

    def fate(self, message: Message, receiver: str, now: float) -> float | str:
        loss, delay = self.profile.loss, self.profile.delay
        if isinstance(loss, BernoulliLoss) and self._loss_draw(loss, message, receiver, now) < loss.probability:
            return "loss"
        u = self._draws.uniform("delay", message.sender, receiver, message.number) if delay.random else 0.5
        seconds = delay.quantile(u)
        if not self.profile.reordering:
            link = (message.sender, receiver)
            last = self._last_arrival.get(link, now)
            seconds = max(seconds, last - now)
            while now + seconds < last:  # rounding
                seconds = math.nextafter(seconds, math.inf)
            self._last_arrival[link] = now + seconds
        return seconds

    def _loss_draw(self, loss: BernoulliLoss, message: Message, receiver: str, now: float) -> float:
        if loss.scope == "link":
            return self._draws.uniform("loss", message.sender, receiver, message.number)
        held = self._frames.get(receiver)
        if held is None or held[0] != now:
            instant = round(now * 1e6)
            held = (now, float(generator(self._seed, "frame loss", receiver, instant).random()))
            self._frames[receiver] = held
        return held[1]
