"""Channel composed of one delay model and one loss model for all links."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss
from eidrive_scenario.v2x.channel import LinkChannel
from eidrive_scenario.v2x.counter_random import LinkRandom
from eidrive_scenario.v2x.link_models.delay import ConstantDelay, Delay, TraceDelay
from eidrive_scenario.v2x.link_models.loss import Loss, LossProcess, NoLoss
from eidrive_scenario.v2x.messages.message import Message
from eidrive_scenario.v2x.profile import ChannelProfile


class ComposedProfile(ChannelProfile):
    """Settings of the composed channel: delay and loss of every link.

    reordering  true: a message may overtake an earlier one of its link, and delays are those drawn; false: a message
                arrives after all earlier ones of its link
    """

    model: Literal["composed"] = "composed"
    delay: Delay = ConstantDelay()
    loss: Loss = NoLoss()
    reordering: bool = True


class ComposedChannel(LinkChannel):
    """Channel that loses or delays each message by two random numbers.

    A message is lost if the first number is below the loss probability p. Otherwise the second number selects the
    quantile of the delay. Both are independent of p: a message that arrives with a larger p also arrives with a
    smaller one.
    """

    settings_type: ClassVar[type[ChannelProfile]] = ComposedProfile

    def __init__(self, profile: ComposedProfile, seed: int) -> None:
        super().__init__()
        self.profile = profile
        self.own_perception = profile.own_perception
        self._losses = LossProcess(profile.loss, seed)
        self._draws = LinkRandom(seed)

    def transmission_outcome(self, message: Message, receiver: str, now: float) -> float | str:
        distance = self.surroundings.distance(message.sender, receiver)
        reason = self._losses.reason(message, receiver, now, distance)
        if reason is not None:
            return reason
        seconds = delay_of(self.profile.delay, self._draws, message, receiver)
        if not self.profile.reordering:
            link = (message.sender, receiver)
            last = self._last_arrival.get(link, now)
            seconds = max(seconds, last - now)
            while now + seconds < last:  # rounding
                seconds = math.nextafter(seconds, math.inf)
            self._last_arrival[link] = now + seconds
        return seconds

    def channel_busy_ratio(self, station: str) -> float | None:
        loss = self.profile.loss
        return loss.table().channel_busy_ratio if isinstance(loss, Ieee80211pLoss | Cv2xMode4Loss) else None


def delay_of(delay: Delay, draws: LinkRandom, message: Message, receiver: str) -> float:
    """Return the delay of this message on this link [s]."""
    if isinstance(delay, ConstantDelay):
        return delay.seconds
    if isinstance(delay, TraceDelay) and delay.replay:
        return delay.seconds[message.number % len(delay.seconds)]
    return delay.quantile(draws.uniform("delay", message.sender, receiver, message.number))
