"""Motion of one driven vehicle over a run: distance, braking, stops, and contacts with their fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eidrive_scenario.evaluation.criterion import Criterion
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation

CONTACT = "contact"
"""Name of the criterion that judges the contacts of the vehicle."""
WINDOW = 0.5
"""Length of the average of the accelerations [s]."""
STANDING = 0.1
"""Maximum speed of a standing vehicle [m/s]."""
DISPLACED = 5.0
"""Time after a contact in which another one is a consequence of the first one [s]."""


@dataclass(frozen=True)
class Stop:
    """Standstill from `time` for `duration` [s] at x, y [m]; `reason` is the most frequent one of the plans."""

    time: float
    duration: float
    x: float
    y: float
    reason: str


class DrivenMotion:
    """Motion of one vehicle, from frames in order.

    A contact is by own fault if the criterion `contact` judges so. One within `DISPLACED` of an earlier contact does
    not count: a vehicle that was hit is pushed against others.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.distance = 0.0
        """Distance covered [m]."""
        self.stops: list[Stop] = []
        self.contacts: list[tuple[float, bool]] = []
        """Time [s] of each contact, and whether it is by own fault."""
        self._times: list[float] = []
        self._speeds: list[float] = []
        self._place: tuple[float, float] | None = None
        self._stopped_at: float | None = None
        self._reasons: Counter[str] = Counter()

    def observe(self, frame: Frame, criteria: Iterable[Criterion]) -> None:
        """Add a frame, which the criteria have observed."""
        view = frame.view
        row = view.rows.get(self._name)
        if row is None:
            self._end_stop(view.time)
            self._place = None
            return
        state = view.states[row]
        if self._place is not None:
            self.distance += float(np.hypot(state.x - self._place[0], state.y - self._place[1]))
        self._place = (state.x, state.y)
        self._times.append(view.time)
        self._speeds.append(state.speed)
        if abs(state.speed) > STANDING:
            self._end_stop(view.time)
        else:
            if self._stopped_at is None:
                self._stopped_at = view.time
            step = frame.steps.get(self._name)
            if step is not None and step.plan is not None:
                self._reasons[step.plan.reason] += 1
        if any(self._name in (contact.first, contact.second) for contact in view.contacts):
            self._add_contacts(view.time, criteria)

    def finish(self) -> None:
        """End the stop in which the run ended."""
        if self._times:
            self._end_stop(self._times[-1])

    def _end_stop(self, time: float) -> None:
        if self._stopped_at is not None and self._place is not None:
            reason = max(self._reasons, key=lambda one: self._reasons[one], default="")
            self.stops.append(Stop(self._stopped_at, time - self._stopped_at, *self._place, reason))
        self._stopped_at = None
        self._reasons.clear()

    def _add_contacts(self, time: float, criteria: Iterable[Criterion]) -> None:
        metrics = next(one.metrics() for one in criteria if one.name == CONTACT)
        count, at_fault = (int(metrics.get(f"{CONTACT}.{key}", 0.0)) for key in ("count", "at_fault"))
        fresh = count - len(self.contacts)
        blamed = at_fault - sum(fault for _, fault in self.contacts)
        self.contacts += [(time, n < blamed) for n in range(fresh)]

    @property
    def collided(self) -> bool:
        """Whether it had a contact."""
        return bool(self.contacts)

    @property
    def at_fault(self) -> bool:
        """Whether a contact was by its own fault and not the consequence of an earlier one."""
        last = -np.inf
        for time, fault in self.contacts:
            if fault and not 0.0 < time - last < DISPLACED:
                return True
            last = time
        return False

    @property
    def longest_stop(self) -> float:
        """Duration of the longest standstill [s]."""
        return max((stop.duration for stop in self.stops), default=0.0)

    @property
    def hardest_braking(self) -> float:
        """Maximum mean deceleration over `WINDOW` before the first contact [m/s²]."""
        times, speeds = np.array(self._times), np.array(self._speeds)
        if self.contacts:
            speeds = speeds[times < self.contacts[0][0]]
        steps = round(WINDOW / (times[1] - times[0])) if len(times) > 1 else 0
        if not 0 < steps < len(speeds):
            return 0.0
        return float(max((speeds[:-steps] - speeds[steps:]).max() / WINDOW, 0.0))


def observed_run(
    scenario: str | Path, vehicle: str, *, seed: int, settings: RunSettings
) -> tuple[RunResult, DrivenMotion]:
    """Run a scenario and return its result and the motion of a vehicle."""
    motion = DrivenMotion(vehicle)
    with Simulation(scenario, seed=seed, settings=settings) as simulation:
        end = None
        while end is None:
            frame, end = simulation.tick()
            motion.observe(frame, simulation.criteria)
        result = simulation.result()
    motion.finish()
    return result, motion
