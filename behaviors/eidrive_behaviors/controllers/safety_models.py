"""Performance models for automated lane keeping: when a situation calls for braking, and how hard.

Sources: UN Regulation No. 157 with its amendments, cited as R157; S. Shalev-Shwartz et al., On a Formal Model of Safe
and Scalable Self-driving Cars, arXiv:1708.06374 (RSS); K. Mattas et al., Fuzzy Surrogate Safety Metrics for real-time
assessment of rear-end collision risk, Accident Analysis & Prevention 148 (2020) 105794 (FSM). Where several values
would do, they are those of the Joint Research Center's program JRC-FSM, which compares these models.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from eidrive_behaviors.controllers.road_ahead import LeadObject

G = 9.81
"""Of R157's decelerations [m/s²]."""
FULL = 0.774 * G
"""Full deceleration of a careful and competent driver [m/s²] (R157 Annex 4 Appendix 3, Table 1)."""
JERK_TIME = 0.6
"""Until full deceleration [s] (there)."""
REACTION = 0.75
"""From having finished perception until starting to decelerate [s] (there)."""


@dataclass(frozen=True)
class EgoKinematics:
    """The car that decides: speed [m/s], acceleration of its last step [m/s²], length of a step [s]."""

    speed: float
    acceleration: float
    dt: float


class SafetyModel(ABC):
    """Decides on the acceleration in a critical situation; one object per driver, as most of them have a memory."""

    reach: ClassVar[float] = 100.0
    """How far it looks [m]."""

    @abstractmethod
    def decide(self, own: EgoKinematics, seen: list[LeadObject]) -> float | None:
        """The acceleration for this step [m/s²], None where nothing is critical."""

    @abstractmethod
    def following_distance(self, own: EgoKinematics, lead: LeadObject) -> float:
        """The gap to keep where nothing is critical [m]."""

    @property
    def lead(self) -> LeadObject | None:
        """Who counted in the last decision."""
        return self._lead

    _lead: LeadObject | None = None


class MemorylessModel(SafetyModel):
    """Looks for the nearest one that matters, and brakes as long as the situation with that one is critical.

    `full_stop`: what was critical once stays so until the car stands.
    """

    reaction: ClassVar[float] = REACTION

    def __init__(self, *, full_stop: bool = False) -> None:
        self.full_stop = full_stop
        self._critical = False
        self._left = 0.0

    def decide(self, own: EgoKinematics, seen: list[LeadObject]) -> float | None:
        """Brake after the reaction time, where it is critical."""
        self._lead = next((one for one in seen if self.matters(own, one)), None)
        held = self._critical and self.full_stop and own.speed > 0.0
        before, self._critical = (
            self._critical,
            held
            or (
                self._lead is not None
                and self._lead.closing > 0.0
                and self._lead.gap > 0.0
                and self.critical(own, self._lead)
            ),
        )
        if not self._critical:
            return None
        if not before:
            self._left = self.reaction
        if self._left > 1e-9:
            self._left -= own.dt
            return min(own.acceleration, 0.0)
        return self.braking(own)

    @abstractmethod
    def matters(self, own: EgoKinematics, one: LeadObject) -> bool:
        """True for one in the lane, or on the way into it."""

    @abstractmethod
    def critical(self, own: EgoKinematics, lead: LeadObject) -> bool:
        """True where the car has to brake for one that it closes in on."""

    def braking(self, own: EgoKinematics) -> float:
        """Full deceleration, by its jerk."""
        return max(own.acceleration - FULL / JERK_TIME * own.dt, -FULL)


class Regulation(MemorylessModel):
    """What R157 requires of the system itself: following distances (5.2.3.3) and cut-ins (5.2.5.2).

    A cut-in counts as soon as the front wheel is 0.3 m inside the lane. It is critical where the time to collision is
    less than v_rel / (2 · 6 m/s²) + 0.35 s, to which JRC-FSM adds a tenth of a second, its sampling interval.
    """

    reach = 46.0
    reaction = 0.0
    DECELERATION = 6.0
    DELAY = 0.35
    SAMPLING = 0.1
    INTRUSION = 0.3

    def matters(self, own: EgoKinematics, one: LeadObject) -> bool:
        """In the lane, or 0.3 m inside it."""
        return one.lanes == 0 or one.intrusion > self.INTRUSION

    def critical(self, own: EgoKinematics, lead: LeadObject) -> bool:
        """By the formula of 5.2.5.2."""
        least = lead.closing / (2.0 * self.DECELERATION) + self.DELAY + self.SAMPLING
        return lead.time_to_collision < least

    def braking(self, own: EgoKinematics) -> float:
        """6 m/s² at once."""
        return -self.DECELERATION

    def following_distance(self, own: EgoKinematics, lead: LeadObject) -> float:
        """The table of 5.2.3.3: 1.0 s at 2 m/s, 1.1 s at 10 km/h, 0.1 s more with each 10 km/h; at least 2 m."""
        kmh = own.speed * 3.6
        gap = 1.0 + kmh / 100.0 if kmh >= 10.0 else 1.0 + 0.1 * max(0.0, own.speed - 2.0) / (10.0 / 3.6 - 2.0)
        return max(2.0, own.speed * gap)


class Rss(MemorylessModel):
    """Responsibility-Sensitive Safety: braking where neither the longitudinal nor the lateral safe distance is kept."""

    ACCELERATION = 3.0
    DECELERATION = FULL
    SIDEWAYS = 1.0
    MARGIN = 0.3

    def matters(self, own: EgoKinematics, one: LeadObject) -> bool:
        """In the lane, or nearer across than the lateral safe distance (lemma 4, for a car that keeps its lane)."""
        if one.lanes == 0 or one.aside <= 0.0:
            return True
        then = one.sideways + self.SIDEWAYS * REACTION
        needed = self.MARGIN + 0.5 * (one.sideways + then) * REACTION + then**2 / (2.0 * self.SIDEWAYS)
        return one.aside < needed

    def critical(self, own: EgoKinematics, lead: LeadObject) -> bool:
        """Nearer than the longitudinal safe distance (lemma 2)."""
        return lead.gap < self._safe(own.speed, lead.speed)

    def following_distance(self, own: EgoKinematics, lead: LeadObject) -> float:
        """The longitudinal safe distance behind one of the own speed."""
        return self._safe(own.speed, own.speed)

    def _safe(self, speed: float, lead: float) -> float:
        then = speed + self.ACCELERATION * REACTION
        covered = 0.5 * (speed + then) * REACTION + then**2 / (2.0 * self.DECELERATION)
        return max(0.0, covered - lead**2 / (2.0 * self.DECELERATION))


class Fsm(MemorylessModel):
    """The fuzzy safety model, R157's second performance model: the harder, the less safe the distance is."""

    reach = 46.0
    COMFORTABLE, HARDEST, LEAD = 4.0, 6.0, 7.0
    STANDING, MARGIN = 2.0, 2.0
    IN_TIME = 0.1

    def matters(self, own: EgoKinematics, one: LeadObject) -> bool:
        """In the lane, or on its way there and not too late to meet the car."""
        if one.lanes == 0 or one.aside <= 0.0:
            return True
        if one.nearing <= 0.0 or one.closing <= 0.0:
            return False
        return one.aside / one.nearing <= one.time_to_collision + self.IN_TIME

    def critical(self, own: EgoKinematics, lead: LeadObject) -> bool:
        """True where one of the two metrics is above 0."""
        self._urgency = self.critical_safety(own, lead)
        self._caution = self.proactive_safety(own, lead)
        return self._urgency + self._caution > 0.0

    def braking(self, own: EgoKinematics) -> float:
        """By the metrics, no harder than the driver's jerk allows."""
        wanted = (
            self.COMFORTABLE + self._urgency * (self.HARDEST - self.COMFORTABLE)
            if self._urgency > 0.0
            else self._caution * self.COMFORTABLE
        )
        return max(super().braking(own), -wanted)

    def following_distance(self, own: EgoKinematics, lead: LeadObject) -> float:
        """From where on the proactive metric is 0."""
        return self.STANDING + self.MARGIN + self._stopping(own.speed, lead.speed, self.COMFORTABLE)

    def proactive_safety(self, own: EgoKinematics, lead: LeadObject) -> float:
        """PFS: 0 where the car could stop comfortably behind a lead that brakes hard, 1 where it could not at all."""
        gap = lead.gap - self.STANDING
        safe = self._stopping(own.speed, lead.speed, self.COMFORTABLE) + self.MARGIN
        return _membership(gap, self._stopping(own.speed, lead.speed, self.HARDEST), safe)

    def critical_safety(self, own: EgoKinematics, lead: LeadObject) -> float:
        """CFS: 0 where the car could slow down to the lead's speed comfortably after its reaction, else up to 1."""
        if lead.closing <= 0.0:
            return 0.0
        slope = max(own.acceleration, -self.COMFORTABLE)
        then = lead.closing + slope * REACTION
        if then < 0.0:
            return 1.0 if lead.gap < lead.closing**2 / (2.0 * abs(own.acceleration)) else 0.0
        reacting = (lead.closing + 0.5 * slope * REACTION) * REACTION
        return _membership(
            lead.gap, reacting + then**2 / (2.0 * self.HARDEST), reacting + then**2 / (2.0 * self.COMFORTABLE)
        )

    def _stopping(self, speed: float, lead: float, deceleration: float) -> float:
        return speed * REACTION + speed**2 / (2.0 * deceleration) - lead**2 / (2.0 * self.LEAD)


def _membership(gap: float, unsafe: float, safe: float) -> float:
    """1 up to the unsafe distance, 0 from the safe one on, in a straight line between."""
    if gap >= safe:
        return 0.0
    return 1.0 if gap <= unsafe else (safe - gap) / (safe - unsafe)
