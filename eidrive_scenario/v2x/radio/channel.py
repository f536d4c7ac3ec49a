"""Radio channel: messages are queued, contend for the medium, and are received according to the link budget."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.channel import Channel, OutgoingMessage, QueuedChannel
from eidrive_scenario.v2x.counter_random import Keys, LinkRandom, combine_keys, key, uniform
from eidrive_scenario.v2x.link_models.composed import delay_of
from eidrive_scenario.v2x.link_models.delay import ConstantDelay
from eidrive_scenario.v2x.link_models.loss import LossProcess, NoLoss
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.v2x.propagation import FadingDraws, Nakagami
from eidrive_scenario.v2x.radio.access import MediumAccess, Transmission
from eidrive_scenario.v2x.radio.budget import Budget, LinkBudget
from eidrive_scenario.v2x.radio.congestion import DccGate
from eidrive_scenario.v2x.radio.csma import Csma
from eidrive_scenario.v2x.radio.events import DroppedBlock, LinkCounterTable, ReceptionBlock
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio.reception import DELIVERED, Receiver
from eidrive_scenario.v2x.radio.sidelink.medium import Sidelink
from eidrive_scenario.v2x.radio_environment import LOS, RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock
from eidrive_scenario.v2x.statistics.link_statistics import ABSENT, LinkStatistics
from eidrive_scenario.v2x.statistics.reception_log import queue_entry

UNDECODABLE = 0.9
"""Packet error rate from which a receiver does not lock to a message (preamble detection as in WiLabV2Xsim)."""
ENERGY_DETECTION_DBM = -65.0
"""Power of any signal from which a station senses a busy channel of 10 MHz [dBm] (IEEE 802.11-2012, 18.3.10.6)."""


class RadioChannel(QueuedChannel):
    """Channel that models the medium as a whole. The outcome of a transmission is known when it has ended.

    Outcomes are therefore returned in a later tick. The first delivery at `now` simulates the medium up to `now`, with
    the current antenna positions. Stations are sorted by name, so that results do not depend on their order.
    """

    settings_type: ClassVar[type[ChannelProfile]] = RadioProfile

    def __init__(self, profile: RadioProfile, seed: int) -> None:
        super().__init__()
        self.profile = profile
        self._seed = seed
        self._link_budget = LinkBudget(profile, seed)
        self._receiver = Receiver(profile)
        background = self._receiver.background
        self._background_ratio = 0.0 if background is None else background[0].channel_busy_ratio
        """Channel busy ratio caused by vehicles that are not simulated."""
        self._losses = LossProcess(profile.loss, seed)
        self._draws = LinkRandom(seed)
        self._rows: dict[str, int] = {}
        self._receivers: dict[str, tuple[tuple[str, ...], Integers]] = {}
        self._fading = FadingDraws(profile.fading, seed) if isinstance(profile.fading, Nakagami) else None
        access = profile.queue, DccGate(profile.congestion, 0, self._background_ratio), profile.sensing, seed
        self._access: MediumAccess = (
            Csma(*access, profile.noise_dbm, profile.curves[LOS].ratio_of(UNDECODABLE))
            if profile.pool is None
            else Sidelink(*access, profile.pool, profile.noise_dbm)
        )
        self._access.fading = self._fading
        self._counters = LinkCounterTable(())
        self._keys: Keys = np.zeros((0, 0), dtype=np.uint64)
        self._jitter_keys: list[int] = []
        self._budget: Budget | None = None
        self._jamming: Array | None = None
        """Power of all jammers at the stations (N,) [mW], in the order of their names; None without a jammer."""
        self._senses_jammer = np.zeros(0, dtype=np.bool_)
        self._jammed: frozenset[str] = frozenset()
        """Stations that sense a channel which jammers occupy, and so do not transmit."""
        self._open: list[Transmission] = []
        self._outcomes: list[OutcomeBlock] = []
        self._dropped: list[LinkEvent] = []
        self._until: float | None = None
        """Time up to which the medium is simulated [s]."""
        self._entry_times: dict[str, float] = {}
        self._last_ready: dict[str, float] = {}
        """Time at which the last message of each station is ready, without reordering [s]."""

    def update_environment(self, surroundings: RadioEnvironment) -> None:
        super().update_environment(surroundings)
        self._budget = None
        if not self.profile.jammers:
            return
        self._jamming = self.profile.jamming_power(surroundings)
        self._senses_jammer = self._jamming >= 10.0 ** (ENERGY_DETECTION_DBM / 10.0)
        self._jammed = frozenset(surroundings.names[row] for row in np.flatnonzero(self._senses_jammer).tolist())

    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        return self.transmit([(message, receivers)], now)

    def transmit(self, outbox: Sequence[OutgoingMessage], now: float) -> Sequence[LinkEvent]:
        self._advance(now)
        offered: list[Transmission] = []
        reports: dict[str, int] = {}
        """Number of the message that determines the jitter of each sender."""
        for message, receivers in outbox:
            rows = self._rows_of(message.sender, receivers)
            if message.sender not in self._rows or len(rows) < len(receivers):
                missing = next(name for name in (message.sender, *receivers) if name not in self._rows)
                raise ValueError(f"station {missing!r} has no antenna position in the radio environment")
            row = self._rows[message.sender]
            # Features are ready with the CPM before them: with a random time for each frame they would enter the queue
            # out of order, and a full queue would drop any of them instead of the last ones
            number = reports.get(message.sender, message.number) if message.kind == "features" else message.number
            reports[message.sender] = number
            ready = now + message.offset + self.profile.jitter * uniform(self._jitter_keys[row], number)
            if not self.profile.reordering:
                ready = self._last_ready[message.sender] = max(ready, self._last_ready.get(message.sender, ready))
            transmission = Transmission(message, receivers, now, ready, self.profile.airtime(message.size))
            self._counters.send(row, rows, message.size)
            if message.sender in self._jammed:
                self._drop(transmission)
            else:
                offered.append(transmission)
        self._access.enqueue(offered)
        return self.drain_events()

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        self._advance(now)
        return super().deliver(receiver, now)

    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        self._counters.flush_into(self._links)
        return super().statistics(now)

    def channel_busy_ratio(self, station: str) -> float | None:
        if station in self._jammed:
            return 1.0
        row = self._rows.get(station)
        if row is None or self._until is None or self._until <= self._entry_times[station]:
            return self._background_ratio
        simulated = self._access.channel_busy_ratio(row, self._until - self._entry_times[station])
        return min(1.0, simulated + self._background_ratio)

    def min_message_interval(self, station: str) -> float:
        row = self._rows.get(station)
        return 0.0 if row is None else self._access.interval(row)

    def continue_from(self, previous: Channel) -> None:
        """Take the links of the previous channel, and from a RadioChannel shadowing and congestion control."""
        super().continue_from(previous)
        if isinstance(previous, RadioChannel) and previous._until is not None:
            self._until = previous._until
            self._set_stations(previous._access.names, self._until)
            self._link_budget.continue_from(previous._link_budget)
            self._access.continue_from(previous._access)

    def finalize(self) -> None:
        if self._until is not None:  # before the first tick there is nothing to determine
            self._advance(math.inf)
        self._counters.flush_into(self._links)

    def drain_events(self) -> Sequence[LinkEvent]:
        events = LinkEvents([super().drain_events(), self._dropped, *self._outcomes])
        self._outcomes, self._dropped = [], []
        return events

    def _rows_of(self, sender: str, receivers: Sequence[str]) -> Integers:
        """Return the rows of present receivers. They are cached, because the receivers of a sender rarely change."""
        cached = self._receivers.get(sender)
        if cached is None or (cached[0] is not receivers and cached[0] != tuple(receivers)):
            rows = np.array([self._rows[name] for name in receivers if name in self._rows], dtype=np.int64)
            cached = self._receivers[sender] = (tuple(receivers), rows)
        return cached[1]

    def _set_stations(self, names: tuple[str, ...], now: float) -> None:
        """Replace the stations. Pending messages of removed stations are lost."""
        self._entry_times = {name: self._entry_times.get(name, now) for name in names}
        self._counters.flush_into(self._links)
        lost = self._access.rearrange(names)
        gone = [transmission for transmission in self._open if transmission.message.sender not in names]
        self._open = [transmission for transmission in self._open if transmission not in gone]
        self._access.active = [
            transmission for transmission in self._access.active if transmission.message.sender in names
        ]
        self._rows = {name: row for row, name in enumerate(names)}
        self._receivers.clear()
        self._counters = LinkCounterTable(names)
        own = np.array([key(self._seed, "reception", name) for name in names], dtype=np.uint64)
        self._keys = combine_keys(own[:, None], own[None, :])
        self._jitter_keys = [key(self._seed, "jitter", name) for name in names]
        if self._fading is not None:
            self._fading.rearrange(names)
        # Of a message that is transmitted again, the last transmission has all receivers without an outcome
        for transmission in [*lost, *(transmission for transmission in gone if not transmission.later)]:
            for receiver in transmission.undecided:
                self._dropped.append(self._links.lose(transmission.message, receiver, transmission.sent, ABSENT))

    def _advance(self, now: float) -> None:
        """Simulate the medium up to `now`. Repeated calls at the same time have no effect."""
        if self._until is None:
            self._until = now
        if self.surroundings.names != self._access.names:
            self._set_stations(self.surroundings.names, self._until)
        if now <= self._until:
            return
        if self._jamming is not None:
            self._access.senses_jammer = self._senses_jammer
            for transmission in self._access.withdraw(self._jammed):
                self._drop(transmission)
        if math.isfinite(now):
            self._until = now
        if self._budget is None:  # also without transmissions: shadowing must not depend on when stations transmit
            self._budget = self._link_budget.at(self.surroundings)
        if not self._open and not self._access.is_waiting:
            self._access.rest(now)
            return
        if self._fading is not None:
            self._fading.distance = self._budget.distance
        power = self.profile.radiated - self._budget.loss
        started, dropped = self._access.advance(now, power)
        for transmission in dropped:
            self._drop(transmission)
        under_way = [*self._open, *started]
        ended = [transmission for transmission in under_way if transmission.end <= now]
        self._open = [transmission for transmission in under_way if transmission.end > now]
        if ended:
            self._receive(ended, power, self._budget)
        self._access.evict_before(min((transmission.start for transmission in self._open), default=now))

    def _drop(self, transmission: Transmission) -> None:
        """Record a message that was dropped from a queue."""
        message = transmission.message
        sender, rows = self._rows[message.sender], self._rows_of(message.sender, transmission.receivers)
        self._counters.drop(sender, rows)
        self._outcomes.append(DroppedBlock(transmission, self._access.names, sender, rows))
        self._record_absent(transmission, rows)

    def _receive(self, ended: Sequence[Transmission], power: Array, budget: Budget) -> None:
        """Determine the receptions of ended transmissions and enqueue their deliveries."""
        receptions = self._receiver.receive(ended, self._access.active, power, budget, self._keys, self._jamming)
        plain = isinstance(self.profile.loss, NoLoss)
        receivers = []
        for index, transmission in enumerate(ended):
            present = self._rows_of(transmission.message.sender, transmission.undecided)
            if transmission.later:
                present = present[receptions.causes[index, present] == DELIVERED]
                transmission.decided.update(budget.names[row] for row in present.tolist())
            else:
                self._record_absent(transmission, present)
            receivers.append(
                present if plain else self._apply_loss(transmission, present, receptions.causes[index], budget)
            )
        block = ReceptionBlock(ended, receptions, budget, receivers)
        self._enqueue_deliveries(block)
        self._counters.decide(
            block.senders,
            block.reached_receivers,
            block.causes,
            budget.distance[block.senders, block.reached_receivers],
        )
        self._outcomes.append(block)

    def _enqueue_deliveries(self, block: ReceptionBlock) -> None:
        """Enqueue delivered messages for their receivers."""
        delivered = np.flatnonzero(block.causes == DELIVERED)
        receivers: list[list[str]] = [[] for _ in block.ended]
        names, delay = block.budget.names, self.profile.delay
        indices = block.indices[delivered]
        for index, row in zip(indices.tolist(), block.reached_receivers[delivered].tolist(), strict=True):
            receivers[index].append(names[row])
        if isinstance(delay, ConstantDelay) and self.profile.reordering:
            ends = np.array([transmission.end + delay.seconds for transmission in block.ended])
            block.arrives[delivered] = ends[indices]
            for transmission, arrives, reached in zip(block.ended, ends.tolist(), receivers, strict=True):
                self._links.enqueue(queue_entry(transmission.message, transmission.sent, arrives), *reached)
            return
        arrivals = []
        for transmission, reached in zip(block.ended, receivers, strict=True):
            for name in reached:
                arrives = transmission.end + delay_of(delay, self._draws, transmission.message, name)
                if not self.profile.reordering:
                    link = (transmission.message.sender, name)
                    arrives = self._last_arrival[link] = max(arrives, self._last_arrival.get(link, arrives))
                arrivals.append(arrives)
                self._links.enqueue(queue_entry(transmission.message, transmission.sent, arrives), name)
        block.arrives[delivered] = arrivals

    def _apply_loss(
        self, transmission: Transmission, rows: Integers, causes: NDArray[np.int8], budget: Budget
    ) -> Integers:
        """Apply the additional loss model; return the rows of receivers without an additional loss."""
        remaining = []
        message, sent = transmission.message, transmission.sent
        for row in rows.tolist():
            name, distance = budget.names[row], float(budget.distance[self._rows[message.sender], row])
            reason = None
            if causes[row] == DELIVERED:
                reason = self._losses.reason(message, name, sent, distance)
            if reason is None:
                remaining.append(row)
            else:
                self._dropped.append(self._links.lose(message, name, sent, reason, distance))
        return np.array(remaining, dtype=np.int64)

    def _record_absent(self, transmission: Transmission, present: Integers) -> None:
        if len(present) < len(transmission.undecided):
            for name in transmission.undecided:
                if name not in self._rows:
                    self._dropped.append(self._links.lose(transmission.message, name, transmission.sent, ABSENT))
