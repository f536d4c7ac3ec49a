"""Performance models for automated lane keeping: criticality of a situation and braking.

Sources: UN Regulation No. 157 with its amendments, cited as R157; S. Shalev-Shwartz et al., On a Formal Model of Safe
and Scalable Self-driving Cars, arXiv:1708.06374 (RSS); K. Mattas et al., Fuzzy Surrogate Safety Metrics for real-time
assessment of rear-end collision risk, Accident Analysis & Prevention 148 (2020) 105794 (FSM). Parameters that these
sources leave open have the values of the Joint Research Center's program JRC-FSM, which compares these models.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from eidrive_behaviors.controllers.road_ahead import LeadObject

G = 9.81
"""Gravity in the decelerations of R157 [m/s²]."""
FULL = 0.774 * G
"""Full deceleration of a careful and competent driver [m/s²] (R157 Annex 4 Appendix 3, Table 1)."""
JERK_TIME = 0.6
"""Time until full deceleration [s] (same table)."""
REACTION = 0.75
"""Time from the end of perception to the start of deceleration [s] (same table)."""


@dataclass(frozen=True)
class EgoKinematics:
    """Kinematics of the ego vehicle: speed [m/s], acceleration of its last step [m/s²], length of a step [s]."""

    speed: float
    acceleration: float
    dt: float


class SafetyModel(ABC):
    """Base class of models that decide on the acceleration in a critical situation.

    Each driver has a separate instance, as most models have state.
    """

    reach: ClassVar[float] = math.inf
    """Range of the search for lead objects [m]; JRC-FSM has no limit."""
    lead: LeadObject | None = None
    """Lead object of the last decision."""

    @abstractmethod
    def decide(self, ego: EgoKinematics, seen: list[LeadObject]) -> float | None:
        """Return the acceleration for this step [m/s²]; None if the situation is not critical."""

    @abstractmethod
    def following_distance(self, ego: EgoKinematics, lead: LeadObject) -> float:
        """Return the gap to keep if the situation is not critical [m]."""


class MemorylessModel(SafetyModel):
    """Base class of models that brake while the situation with the nearest relevant object is critical.

    `full_stop`: a critical situation remains critical until standstill.
    """

    reaction: ClassVar[float] = REACTION

    def __init__(self, *, full_stop: bool = False) -> None:
        self.full_stop = full_stop
        self._critical = False
        self._left = 0.0

    def decide(self, ego: EgoKinematics, seen: list[LeadObject]) -> float | None:
        """Return the braking acceleration after the reaction time [m/s²]; None if the situation is not critical."""
        self.lead = next((candidate for candidate in seen if self.matters(ego, candidate)), None)
        before, lead = self._critical, self.lead
        self._critical = lead is not None and lead.closing > 0.0 and lead.gap > 0.0 and self.critical(ego, lead)
        self._critical = self._critical or (before and self.full_stop and ego.speed > 0.0)
        if not self._critical:
            return None
        if not before:
            self._left = self.reaction
        if self._left > 1e-9:
            self._left -= ego.dt
            return min(ego.acceleration, 0.0)
        return self.braking(ego)

    @abstractmethod
    def matters(self, ego: EgoKinematics, candidate: LeadObject) -> bool:
        """Return True for an object in the lane, or on its way into the lane."""

    @abstractmethod
    def critical(self, ego: EgoKinematics, lead: LeadObject) -> bool:
        """Return True if the car has to brake for an object that it approaches."""

    def braking(self, ego: EgoKinematics) -> float:
        """Return the full deceleration, limited by its jerk [m/s²]."""
        return max(ego.acceleration - FULL / JERK_TIME * ego.dt, -FULL)


class Regulation(MemorylessModel):
    """Requirements of R157 on the system itself: following distances (5.2.3.3) and cut-ins (5.2.5.2).

    The range is the detection range that the regulation requires at 60 km/h. A cut-in counts as soon as the front wheel
    is 0.3 m inside the lane. It is critical if the time to collision is less
    than v_rel / (2 · 6 m/s²) + 0.35 s. JRC-FSM adds 0.1 s, its sampling interval.
    """

    reach = 46.0
    reaction = 0.0
    DECELERATION = 6.0
    DELAY = 0.35
    SAMPLING = 0.1
    INTRUSION = 0.3

    def matters(self, ego: EgoKinematics, candidate: LeadObject) -> bool:
        """Return True in the lane, or 0.3 m inside it."""
        return candidate.lanes == 0 or candidate.intrusion > self.INTRUSION

    def critical(self, ego: EgoKinematics, lead: LeadObject) -> bool:
        """Return True by the formula of 5.2.5.2."""
        least = lead.closing / (2.0 * self.DECELERATION) + self.DELAY + self.SAMPLING
        return lead.time_to_collision < least

    def braking(self, ego: EgoKinematics) -> float:
        """Return -6 m/s² at once."""
        return -self.DECELERATION

    def following_distance(self, ego: EgoKinematics, lead: LeadObject) -> float:
        """Return the distance by the table of 5.2.3.3 [m], at least 2 m.

        The time gap is 1.0 s at 2 m/s, 1.1 s at 10 km/h and 0.1 s more with each 10 km/h.
        """
        kmh = ego.speed * 3.6
        gap = 1.0 + kmh / 100.0 if kmh >= 10.0 else 1.0 + 0.1 * max(0.0, ego.speed - 2.0) / (10.0 / 3.6 - 2.0)
        return max(2.0, ego.speed * gap)


class Rss(MemorylessModel):
    """Responsibility-Sensitive Safety: braking if neither the longitudinal nor the lateral safe distance is kept."""

    ACCELERATION = 3.0
    DECELERATION = FULL
    SIDEWAYS = 1.0
    MARGIN = 0.3

    def matters(self, ego: EgoKinematics, candidate: LeadObject) -> bool:
        """Return True in the lane, or within the lateral safe distance (lemma 4, for a car that keeps its lane)."""
        if candidate.lanes == 0 or candidate.aside <= 0.0:
            return True
        then = candidate.sideways + self.SIDEWAYS * REACTION
        needed = self.MARGIN + 0.5 * (candidate.sideways + then) * REACTION + then**2 / (2.0 * self.SIDEWAYS)
        return candidate.aside < needed

    def critical(self, ego: EgoKinematics, lead: LeadObject) -> bool:
        """Return True within the longitudinal safe distance (lemma 2)."""
        return lead.gap < self._safe(ego.speed, lead.speed)

    def following_distance(self, ego: EgoKinematics, lead: LeadObject) -> float:
        """Return the longitudinal safe distance behind an object of the own speed [m]."""
        return self._safe(ego.speed, ego.speed)

    def _safe(self, speed: float, lead: float) -> float:
        then = speed + self.ACCELERATION * REACTION
        covered = 0.5 * (speed + then) * REACTION + then**2 / (2.0 * self.DECELERATION)
        return max(0.0, covered - lead**2 / (2.0 * self.DECELERATION))


class Fsm(MemorylessModel):
    """Fuzzy safety model, the second performance model of R157: it brakes harder, the less safe the distance is."""

    COMFORTABLE, HARDEST, LEAD = 4.0, 6.0, 7.0
    STANDING, MARGIN = 2.0, 2.0
    IN_TIME = 0.1

    def matters(self, ego: EgoKinematics, candidate: LeadObject) -> bool:
        """Return True in the lane, or on the way into it in time to meet the car."""
        if candidate.lanes == 0 or candidate.aside <= 0.0:
            return True
        if candidate.nearing <= 0.0 or candidate.closing <= 0.0:
            return False
        return candidate.aside / candidate.nearing <= candidate.time_to_collision + self.IN_TIME

    def critical(self, ego: EgoKinematics, lead: LeadObject) -> bool:
        """Return True if one of both metrics is above 0."""
        urgency, caution = self.critical_safety(ego, lead), self.proactive_safety(ego, lead)
        if urgency + caution > 0.0:  # with a full stop, the last ones apply until standstill
            self._urgency, self._caution = urgency, caution
        return urgency + caution > 0.0

    def braking(self, ego: EgoKinematics) -> float:
        """Return the deceleration by the metrics, limited by the driver's jerk [m/s²]."""
        wanted = (
            self.COMFORTABLE + self._urgency * (self.HARDEST - self.COMFORTABLE)
            if self._urgency > 0.0
            else self._caution * self.COMFORTABLE
        )
        return max(super().braking(ego), -wanted)

    def following_distance(self, ego: EgoKinematics, lead: LeadObject) -> float:
        """Return the gap from which the proactive metric is 0 [m]."""
        return self.STANDING + self.MARGIN + self._stopping(ego.speed, lead.speed, self.COMFORTABLE)

    def proactive_safety(self, ego: EgoKinematics, lead: LeadObject) -> float:
        """Return the PFS metric: 0 if the car can stop comfortably behind a hard-braking lead, 1 if it cannot stop."""
        gap = lead.gap - self.STANDING
        safe = self._stopping(ego.speed, lead.speed, self.COMFORTABLE) + self.MARGIN
        return _membership(gap, self._stopping(ego.speed, lead.speed, self.HARDEST), safe)

    def critical_safety(self, ego: EgoKinematics, lead: LeadObject) -> float:
        """Return the CFS metric: 0 if the car can comfortably slow down to the lead's speed after its reaction, else up
        to 1.
        """
        if lead.closing <= 0.0:
            return 0.0
        slope = max(ego.acceleration, -self.COMFORTABLE)
        then = lead.closing + slope * REACTION
        if then < 0.0:
            return 1.0 if lead.gap < lead.closing**2 / (2.0 * abs(ego.acceleration)) else 0.0
        reacting = (lead.closing + 0.5 * slope * REACTION) * REACTION
        return _membership(
            lead.gap, reacting + then**2 / (2.0 * self.HARDEST), reacting + then**2 / (2.0 * self.COMFORTABLE)
        )

    def _stopping(self, speed: float, lead: float, deceleration: float) -> float:
        return speed * REACTION + speed**2 / (2.0 * deceleration) - lead**2 / (2.0 * self.LEAD)


def _membership(gap: float, unsafe: float, safe: float) -> float:
    """Return 1 up to the unsafe distance, 0 from the safe one on, linear between."""
    if gap >= safe:
        return 0.0
    return 1.0 if gap <= unsafe else (safe - gap) / (safe - unsafe)
