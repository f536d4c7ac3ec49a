"""The radio channel: messages queue, contend for the medium, and reach whom the link budget lets them reach."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.v2x.channel import OutgoingMessage
from eidrive_scenario.v2x.counter_random import Keys, combine_keys, key, uniform
from eidrive_scenario.v2x.link_channel import LinkChannel
from eidrive_scenario.v2x.link_models.composed import delay_of
from eidrive_scenario.v2x.link_models.delay import ConstantDelay
from eidrive_scenario.v2x.link_models.loss import NoLoss
from eidrive_scenario.v2x.link_models.loss_process import LossProcess
from eidrive_scenario.v2x.link_random import LinkRandom
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.v2x.propagation.fading import FadingDraws, Nakagami
from eidrive_scenario.v2x.propagation.path_loss import Tr37885
from eidrive_scenario.v2x.radio.access import MediumAccess, Transmission
from eidrive_scenario.v2x.radio.budget import Budget, LinkBudget
from eidrive_scenario.v2x.radio.congestion import DccGate
from eidrive_scenario.v2x.radio.csma import Csma
from eidrive_scenario.v2x.radio.events import DroppedBlock, ReceptionBlock
from eidrive_scenario.v2x.radio.link_counter_table import LinkCounterTable
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio.reception import DELIVERED, Receiver
from eidrive_scenario.v2x.radio.sidelink.medium import Sidelink
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock
from eidrive_scenario.v2x.statistics.links import LinkStatistics
from eidrive_scenario.v2x.statistics.reception_log import Entry

Rows = NDArray[np.int64]

ABSENT = "absent"
"""The reason of loss where sender or receiver has left the world."""


class RadioChannel(LinkChannel):
    """What a message meets on its way is known when it has left the air, so its fate is told in a later tick.

    The medium is played up to `now` when somebody first listens at `now`, with the antennas where they are then.
    Stations are kept in alphabetical order: nothing depends on the order in which they are listed.
    """

    settings: ClassVar[type[ChannelProfile]] = RadioProfile

    def __init__(self, profile: RadioProfile, seed: int) -> None:
        super().__init__()
        self.profile = profile
        self._seed = seed
        path_loss = profile.path_loss
        self._link_budget = LinkBudget(
            path_loss,
            seed=seed,
            frequency_ghz=profile.frequency_ghz,
            line_of_sight=profile.line_of_sight,
            environment=path_loss.environment if isinstance(path_loss, Tr37885) else "highway",
            shadowing_db=profile.shadowing_db,
            decorrelation=profile.decorrelation,
        )
        self._receiver = Receiver(
            tuple(profile.noise_in(width) for width in range(1, profile.most_subchannels + 1)),
            profile.sensing,
            profile.curves,
            locks=profile.technology == "80211p",
            background=profile.background_by_loss(),
        )
        background = self._receiver.background
        self._outside = 0.0 if background is None else background[0].channel_busy_ratio
        """Share of the time in which vehicles that are not simulated fill the channel."""
        self._losses = LossProcess(profile.loss, seed)
        self._draws = LinkRandom(seed)
        self._rows: dict[str, int] = {}
        self._listeners: dict[str, tuple[list[str], Rows]] = {}
        self._fading = FadingDraws(profile.fading, seed) if isinstance(profile.fading, Nakagami) else None
        self._access = self._new_access(())
        self._access.fading = self._fading
        self._ledger = LinkCounterTable(())
        self._keys: Keys = np.zeros((0, 0), dtype=np.uint64)
        self._jitter_keys: list[int] = []
        self._budget: Budget | None = None
        self._open: list[Transmission] = []
        self._told: list[OutcomeBlock] = []
        self._dropped: list[LinkEvent] = []
        self._until: float | None = None
        """Up to when the medium was played [s]."""
        self._joined: dict[str, float] = {}
        self._last_arrival: dict[tuple[str, str], float] = {}

    def _new_access(self, names: tuple[str, ...]) -> MediumAccess:
        profile = self.profile
        gate = DccGate(profile.congestion, len(names), self._outside)
        if profile.technology == "80211p":
            return Csma(names, profile.queue, gate, profile.sensing, self._seed)
        return Sidelink(names, profile.queue, gate, profile.sensing, self._seed, profile.sidelink, profile.noise_dbm)

    def transmission_outcome(self, message: Message, receiver: str, now: float) -> float | str:
        """Nothing can be said of one link alone. Raises TypeError."""
        raise TypeError("a radio decides about messages together: use transmit")

    def update_environment(self, surroundings: RadioEnvironment) -> None:
        super().update_environment(surroundings)
        self._budget = None

    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        return self.transmit([(message, receivers)], now)

    def transmit(self, outbox: Sequence[OutgoingMessage], now: float) -> Sequence[LinkEvent]:
        self._advance(now)
        offered = []
        for message, receivers in outbox:
            row = self._row(message.sender)
            ready = now + self.profile.jitter * uniform(self._jitter_keys[row], message.number)
            offered.append(Transmission(message, receivers, now, ready, self.profile.airtime(message.size)))
            rows = self._rows_of(message.sender, receivers)
            if len(rows) < len(receivers):
                missing = next(name for name in receivers if name not in self._rows)
                raise ValueError(f"the radio was not told where {missing!r} is")
            self._ledger.send(row, rows, message.size)
        self._access.enqueue(offered)
        return self.drain_events()

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        self._advance(now)
        return super().deliver(receiver, now)

    def in_flight(self) -> int:
        undecided = sum(len(entry.receivers) for entry in [*self._access.waiting, *self._open])
        return super().in_flight() + undecided

    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        self._ledger.flush_into(self._links)
        return super().statistics(now)

    def channel_busy_ratio(self, station: str) -> float | None:
        row = self._rows.get(station)
        if row is None or self._until is None or self._until <= self._joined[station]:
            return self._outside
        return min(1.0, self._access.channel_busy_ratio(row, self._until - self._joined[station]) + self._outside)

    def min_message_interval(self, station: str) -> float:
        row = self._rows.get(station)
        return 0.0 if row is None else self._access.interval(row)

    def finalize(self) -> None:
        self._advance(math.inf)
        self._ledger.flush_into(self._links)

    def drain_events(self) -> Sequence[LinkEvent]:
        told = LinkEvents([super().drain_events(), self._dropped, *self._told])
        self._told, self._dropped = [], []
        return told

    def _rows_of(self, sender: str, receivers: Sequence[str]) -> Rows:
        """The rows of those among the receivers who are there; the same ones listen to a sender most of the time."""
        held = self._listeners.get(sender)
        if held is None or held[0] != list(receivers):
            rows = np.array([self._rows[name] for name in receivers if name in self._rows], dtype=np.int64)
            held = self._listeners[sender] = (list(receivers), rows)
        return held[1]

    def _row(self, name: str) -> int:
        row = self._rows.get(name)
        if row is None:
            raise ValueError(f"the radio was not told where {name!r} is")
        return row

    def _take_in(self, names: tuple[str, ...], now: float) -> None:
        """Other stations from now on; what those say who have left is lost."""
        self._joined = {name: self._joined.get(name, now) for name in names}
        self._ledger.flush_into(self._links)
        lost = self._access.rearrange(names)
        gone = [entry for entry in self._open if entry.message.sender not in names]
        self._open = [entry for entry in self._open if entry not in gone]
        self._access.on_air = [entry for entry in self._access.on_air if entry.message.sender in names]
        self._rows = {name: row for row, name in enumerate(names)}
        self._listeners.clear()
        self._ledger = LinkCounterTable(names)
        own = np.array([key(self._seed, "reception", name) for name in names], dtype=np.uint64)
        self._keys = combine_keys(own[:, None], own[None, :])
        self._jitter_keys = [key(self._seed, "jitter", name) for name in names]
        if self._fading is not None:
            self._fading.rearrange(names)
        for entry in [*lost, *gone]:
            for receiver in entry.receivers:
                self._lose(entry, receiver, ABSENT)

    def _advance(self, now: float) -> None:
        """Play the medium up to `now`; more than once at one instant does nothing."""
        if self._until is None:
            self._until = now
        if self.surroundings.names != self._access.names:
            self._take_in(self.surroundings.names, self._until)
        if now <= self._until:
            return
        if math.isfinite(now):
            self._until = now
        if self._budget is None:  # even where nobody talks: who talks when shall not shift the draws of shadowing
            self._budget = self._link_budget.at(self.surroundings)
        if not self._open and not self._access.waiting:
            self._access.rest(now)
            return
        if self._fading is not None:
            self._fading.distance = self._budget.distance
        power = self.profile.radiated - self._budget.loss
        started, dropped = self._access.advance(now, power)
        for entry in dropped:
            self._drop(entry)
        under_way = [*self._open, *started]
        ended = [entry for entry in under_way if entry.end <= now]
        self._open = [entry for entry in under_way if entry.end > now]
        if ended:
            self._receive(ended, power, self._budget)
        self._access.forget(min((entry.start for entry in self._open), default=now))

    def _drop(self, entry: Transmission) -> None:
        """A queue has thrown a message out."""
        message = entry.message
        sender, rows = self._rows[message.sender], self._rows_of(message.sender, entry.receivers)
        self._ledger.drop(sender, rows)
        self._told.append(DroppedBlock(entry, self._access.names, sender, rows))
        self._lose_absent(entry, rows)

    def _receive(self, ended: Sequence[Transmission], power: Array, budget: Budget) -> None:
        """Decide who hears the messages that have left the air, and put them on their way."""
        receptions = self._receiver.receive(ended, self._access.on_air, power, budget, self._keys)
        plain = isinstance(self.profile.loss, NoLoss)
        receivers = []
        for place, entry in enumerate(ended):
            present = self._rows_of(entry.message.sender, entry.receivers)
            self._lose_absent(entry, present)
            receivers.append(
                present if plain else self._pending_at_switch(entry, present, receptions.causes[place], budget)
            )
        batch = ReceptionBlock(ended, receptions, budget, receivers)
        self._carry(batch)
        self._ledger.decide(
            batch.senders,
            batch.reached_receivers,
            batch.causes,
            budget.distance[batch.senders, batch.reached_receivers],
        )
        self._told.append(batch)

    def _carry(self, batch: ReceptionBlock) -> None:
        """Put the messages on their way to those who hear them."""
        heard = np.flatnonzero(batch.causes == DELIVERED)
        receivers: list[list[str]] = [[] for _ in batch.ended]
        names, delay = batch.budget.names, self.profile.delay
        places = batch.places[heard]
        for place, row in zip(places.tolist(), batch.reached_receivers[heard].tolist(), strict=True):
            receivers[place].append(names[row])
        if isinstance(delay, ConstantDelay):
            ends = np.array([entry.end + delay.seconds for entry in batch.ended])
            batch.arrives[heard] = ends[places]
            for entry, arrives, hearing in zip(batch.ended, ends.tolist(), receivers, strict=True):
                self._links.enqueue(_parcel(entry, arrives), *hearing)
            return
        arrivals = []
        for entry, hearing in zip(batch.ended, receivers, strict=True):
            for name in hearing:
                arrives = entry.end + delay_of(delay, self._draws, entry.message, name)
                if not self.profile.reordering:
                    link = (entry.message.sender, name)
                    arrives = self._last_arrival[link] = max(arrives, self._last_arrival.get(link, arrives))
                arrivals.append(arrives)
                self._links.enqueue(_parcel(entry, arrives), name)
        batch.arrives[heard] = arrivals

    def _pending_at_switch(self, entry: Transmission, rows: Rows, causes: NDArray[np.int8], budget: Budget) -> Rows:
        """Those among the receivers for whom the loss that comes on top of the radio does not strike."""
        spared = []
        sender = self._rows[entry.message.sender]
        for row in rows.tolist():
            distance = float(budget.distance[sender, row])
            reason = None
            if causes[row] == DELIVERED:
                reason = self._losses.reason(entry.message, budget.names[row], entry.sent, distance)
            if reason is None:
                spared.append(row)
            else:
                self._lose(entry, budget.names[row], reason, distance)
        return np.array(spared, dtype=np.int64)

    def _lose_absent(self, entry: Transmission, present: Rows) -> None:
        if len(present) < len(entry.receivers):
            for name in entry.receivers:
                if name not in self._rows:
                    self._lose(entry, name, ABSENT)

    def _lose(self, entry: Transmission, receiver: str, reason: str, distance: float | None = None) -> None:
        """A message that was written down as sent is lost for a reason that the reception does not know."""
        message = entry.message
        book = self._links.counters(message.sender, receiver)
        book.count_loss(reason)
        if distance is not None:
            book.count_outcome(distance, False)
        self._dropped.append(
            LinkEvent(message.sender, receiver, message.number, entry.sent, "lost", None, reason, message.size)
        )


def _parcel(entry: Transmission, arrives: float) -> Entry:
    """A message on its way to whoever hears it at this instant [s]."""
    message = entry.message
    return arrives, message.sender, message.number, entry.sent, ReceivedMessage(message, arrives)
