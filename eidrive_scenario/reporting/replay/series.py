"""Quantities of the stations over time, and the decisive instant of a run."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.evaluation.nearest_actor import min_time_to_collision, nearest_body, nearest_pair
from eidrive_scenario.recording.frame import Frame

TTC_LIMIT = 10.0
"""Maximum time to collision in the charts [s]."""
FAR = 100.0
"""Maximum gap in the charts [m]."""
Values = dict[str, Any]


class SeriesBuilder:
    """Observer of the frames of a run.

    columns   by station and frame: speed [m/s], gap to the nearest body [m], smallest time to collision [s], and by
              sender the age of information [s], the time since the newest received message was generated, and the
              number of messages so far that were too old on arrival. None: absent, farther than FAR, above TTC_LIMIT,
              nothing received yet, none too old yet
    contact   the first contact of a driven vehicle or of its trailers: time [s] and description with the relative speed
              at the impact; None without a contact
    decisive  that contact, else the smallest gap of a driven vehicle. Without driven vehicles all actors are
              considered; None if no two actors were present at the same time
    """

    def __init__(self) -> None:
        self._frames = 0
        self._columns: dict[str, dict[tuple[str, str], list[Any]]] = {}
        """Columns by station, and by their name with the sender, "" for those of the station itself."""
        self._generated: dict[str, dict[str, float]] = {}
        """Time of generation of the newest message by receiver and sender [s]."""
        self._expired: dict[str, dict[str, int]] = {}
        """Number of messages that were too old on arrival, by receiver and sender."""
        self._pending: dict[str, dict[tuple[str, str], Any]] = {}
        self._driven = False
        self._contact: tuple[float, str] | None = None
        self._least = (math.inf, 0.0, "")

    def observe(self, frame: Frame) -> None:
        """Measure one frame; `keep` adds it to the columns."""
        view, now = frame.view, frame.view.time
        self._pending = {}
        driven = [name for name, step in frame.steps.items() if step.control is not None and name in view]
        is_finite = bool(np.isfinite(view.boxes).all() and np.isfinite(view.velocity).all())
        self._note_contact(frame, driven)
        for name, step in frame.steps.items():
            newest = self._generated.setdefault(name, {})
            for received in step.inbox:
                sender = received.message.sender
                if sender != name:
                    newest[sender] = max(newest.get(sender, -math.inf), received.message.generated)
            expired = self._expired.setdefault(name, {})
            for row in step.expired:
                sender = step.inbox[row].message.sender
                expired[sender] = expired.get(sender, 0) + 1
            values = self._pending[name] = {}
            if name in driven:
                attached = frame.attached(name)
                gap, other = nearest_body(view, name, attached)
                self._note_gap(gap, now, f"{name} and {other}")
                ttc = min_time_to_collision(view, name, TTC_LIMIT, attached) if is_finite else math.inf
                values["speed", ""] = rounded(float(view.speed[view.row(name)]), 2)
                values["gap", ""] = rounded(gap, 2) if gap <= FAR else None
                values["ttc", ""] = rounded(ttc, 2)
            values |= {("age", sender): rounded(now - generated, 3) for sender, generated in newest.items()}
            values |= {("expired", sender): number for sender, number in expired.items()}

    @property
    def width(self) -> int:
        """Number of columns including the last frame."""
        return sum(3 + len(senders) + len(self._expired[name]) for name, senders in self._generated.items())

    def keep(self) -> None:
        """Add the values of the last frame."""
        for name, values in self._pending.items():
            columns = self._columns.setdefault(name, {})
            for key, value in values.items():
                _pad(columns.setdefault(key, []), self._frames).append(value)
        self._frames += 1

    def take(self) -> dict[str, Values]:
        """Return the columns by station since the last call, without those that have no value."""
        series: dict[str, Values] = {}
        for name, columns in self._columns.items():
            of_station = series[name] = {}
            for (key, sender), values in columns.items():
                _pad(values, self._frames)
                if sender:
                    of_station.setdefault(key, {})[sender] = values
                elif any(value is not None for value in values):
                    of_station[key] = values
        self._columns, self._frames = {}, 0
        return series

    @property
    def contact(self) -> Values | None:
        """First contact."""
        return None if self._contact is None else {"time": round(self._contact[0], 4), "text": self._contact[1]}

    @property
    def decisive(self) -> Values | None:
        """Decisive instant."""
        gap, time, pair = self._least
        if self.contact is not None or not math.isfinite(gap):
            return self.contact
        return {"time": round(time, 4), "text": f"smallest gap of {pair}: {gap:.2f} m"}

    def _note_contact(self, frame: Frame, driven: list[str]) -> None:
        if driven and not self._driven:
            self._driven, self._contact, self._least = True, None, (math.inf, 0.0, "")
        for contact in frame.view.contacts if self._contact is None else ():
            trains = {*driven}.union(*map(frame.attached, driven))
            if not self._driven or contact.first in trains or contact.second in trains:
                text = f"contact of {contact.first} and {contact.second}"
                if math.isfinite(contact.impact_speed):
                    text += f" at {contact.impact_speed:.1f} m/s"
                self._contact = frame.view.time, text
                return
        if not self._driven and (pair := nearest_pair(frame.view, self._least[0], frame.trailers)) is not None:
            gap, name, other = pair
            self._note_gap(gap, frame.view.time, f"{name} and {other}")

    def _note_gap(self, gap: float, time: float, pair: str) -> None:
        # In recordings of former versions a vehicle and its trailer touch without a contact.
        if 0.0 < gap < self._least[0]:
            self._least = gap, time, pair


def closest_approach(
    metrics: Mapping[str, float | None], verdicts: Sequence[Verdict], names: Collection[str] = ()
) -> Values | None:
    """Return the instant of the smallest distance that a criterion `min_distance` measured, or None.

    names     names of the actors, which may contain dots
    verdicts  those of the run: a criterion measures either the distance of the centers or that of the bodies, and the
              time among its metrics is that of the measured one
    """
    numbers = {name: value for name, value in metrics.items() if value is not None and math.isfinite(value)}
    approaches = []
    for name, time in numbers.items():
        if name.startswith("min_distance.") and name.endswith(".time"):
            pair = name.removeprefix("min_distance.").removesuffix(".time")
            center, box = (numbers.get(f"min_distance.{pair}.{measure}") for measure in ("center", "box"))
            # Of two criteria for one pair, the last one counts, whose time may begin with its own name
            both = [verdict for verdict in verdicts if verdict.value is not None and verdict.value in (center, box)]
            measured, when = center, time
            if both:
                measured, when = both[-1].value, numbers.get(f"{both[-1].name}.{pair}.time", time)
            if measured is not None:
                ends = "centers" if measured == center else "bodies"
                approaches.append((measured, when, _pair_text(pair, names), ends))
    if not approaches:
        return None
    distance, time, pair, ends = min(approaches)
    return {"time": round(time, 4), "text": f"closest approach of {pair}: {distance:.2f} m between {ends}"}


def _pair_text(pair: str, names: Collection[str]) -> str:
    """Return the text of the two names in `A.B`; the same text if a dot in a name leaves them unknown."""
    parts = pair.split(".")
    splits = [(".".join(parts[:count]), ".".join(parts[count:])) for count in range(1, len(parts))]
    named = [split for split in splits if split[0] in names and split[1] in names]
    possible = named or (splits if len(splits) == 1 else [])
    return " and ".join(possible[0]) if possible else pair


def rounded(value: float, digits: int) -> float | None:
    """Return a number with so many decimals; None for one that is not finite, which JSON does not have."""
    return round(value, digits) if math.isfinite(value) else None


def _pad(values: list[Any], count: int) -> list[Any]:
    """Extend a list in place to `count` entries by None, and return it."""
    values.extend([None] * (count - len(values)))
    return values
