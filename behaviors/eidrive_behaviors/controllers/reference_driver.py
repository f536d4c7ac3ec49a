"""The careful and competent human driver of UN Regulation No. 157, Annex 4 Appendix 3."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import ClassVar

from eidrive_behaviors.controllers.road_ahead import LeadObject
from eidrive_behaviors.controllers.safety_models import FULL, JERK_TIME, REACTION, EgoKinematics, G, SafetyModel

TINY = 1e-9
WANDERING = 0.375
"""Further than this from the middle of its lane a vehicle is leaving it [m] (Table 1, risk perception point)."""
HARD = 5.0
"""A lead that brakes harder than this is a risk [m/s²] (3.3, deceleration)."""
DANGEROUS = 2.0
"""Time to collision of a cut-in, or headway in the two other cases, below which it is dangerous [s] (3.1 to 3.3)."""
EMERGENCY = 0.85 * G
"""Full deceleration after full wrap [m/s²] (Table 1; derived from UN Regulation No. 152)."""
RELEASE = 0.4
"""Deceleration as the foot leaves the pedal [m/s²] (JRC-FSM)."""


class Risk(Enum):
    """The three scenarios of the model."""

    NONE = auto()
    CUT_IN = auto()
    CUT_OUT = auto()
    DECELERATION = auto()


class DriverPhase(Enum):
    """Of the driver: not at risk, evaluating one, moving the foot, braking."""

    CALM = auto()
    PERCEIVING = auto()
    REACTING = auto()
    BRAKING = auto()


@dataclass(frozen=True)
class ReferenceDriverSettings:
    """What scenarios may say of the driver.

    evaluation    risk evaluation time [s]
    pedestrians   the same for pedestrians who walk towards the lane [s]
    distance      how far a cutting-in vehicle moves while it is evaluated, in place of the time [m]; None: by time
    moved         a cut-in begins with so much motion sideways [m]; None: 0.375 m from the middle of the lane
    emergency     time to collision below which the car's emergency brake helps after full wrap [s]
    full_stop     True: who once brakes does so until the car stands
    always        True: every perceived risk is dangerous
    """

    evaluation: float = 0.4
    pedestrians: float = 0.4
    distance: float | None = None
    moved: float | None = None
    emergency: float = 1.5
    full_stop: bool = False
    always: bool = False


class ReferenceDriver(SafetyModel):
    """Perceives a risk, evaluates it for 0.4 s, takes 0.75 s to react, and brakes: 0.774 G, reached in 0.6 s.

    A cut-in is perceived at 0.375 m from the middle of the lane and dangerous below 2 s to collision; a cut-out that
    reveals somebody, and a lead that brakes by more than 5 m/s², below 2 s of headway. After full wrap the emergency
    brake helps, by 0.85 G in 0.6 s; the two slopes add up, which the regulation leaves open.
    """

    reach: ClassVar[float] = 100.0

    def __init__(self, settings: ReferenceDriverSettings | None = None) -> None:
        self.settings = settings or ReferenceDriverSettings()
        self.phase = DriverPhase.CALM
        self.risk = Risk.NONE
        self._left = 0.0
        self._perceived_at = 0.0
        self._emergency = False
        self._began: dict[str, float] = {}

    def decide(self, own: EgoKinematics, seen: list[LeadObject]) -> float | None:
        """One step of perceiving, reacting or braking."""
        self._watch(seen)
        self._focus(seen)
        self._advance(own)
        lead = self._lead
        if lead is not None and lead.covers and lead.time_to_collision < self.settings.emergency:
            self._emergency = True
        if self.phase is not DriverPhase.BRAKING and not self._emergency:
            return None
        return self._braking(own)

    def following_distance(self, own: EgoKinematics, lead: LeadObject) -> float:
        """Two seconds and two meters, the headway below which a lead is dangerous."""
        return 2.0 + DANGEROUS * own.speed

    def _watch(self, seen: list[LeadObject]) -> None:
        """Remember where those who move towards the lane began to."""
        self._began = {one.name: self._began.get(one.name, one.across) for one in seen if one.nearing > TINY}

    def _focus(self, seen: list[LeadObject]) -> None:
        held = self.phase is not DriverPhase.CALM and self.settings.full_stop
        if held and self._lead is not None:
            name = self._lead.name
            self._lead = next((one for one in seen if one.name == name), self._lead)
            return
        before = self._lead.name if self._lead is not None else None
        self._lead, risk = self._most_urgent(seen)
        changed = self._lead is not None and (self._lead.name != before or risk is not self.risk)
        if changed and risk is not Risk.NONE:
            self.risk = risk

    def _most_urgent(self, seen: list[LeadObject]) -> tuple[LeadObject | None, Risk]:
        """The nearest one that is in the lane or cuts in; behind one that leaves the lane who is met first."""
        found: LeadObject | None = None
        risk = Risk.NONE
        for one in seen:
            its = self._risk_of(one)
            if its is None:
                continue
            if found is None:
                found, risk = one, its
            elif risk is Risk.CUT_OUT and one.lanes == 0 and one.time_to_collision < found.time_to_collision:
                found = one
        return found, risk

    def _risk_of(self, one: LeadObject) -> Risk | None:
        """What the driver makes of one; None for one that is beside the lane and stays there."""
        if one.walks:
            return Risk.CUT_IN if one.nearing > TINY else None
        if one.lanes == 0:
            if abs(one.towards) > WANDERING and one.nearing < -TINY:
                return Risk.CUT_OUT
            return Risk.DECELERATION if one.change < -HARD else Risk.NONE
        return Risk.CUT_IN if self._cuts_in(one) else None

    def _cuts_in(self, one: LeadObject) -> bool:
        if one.name not in self._began:
            return False
        if self.settings.moved is None:
            return one.towards > WANDERING
        return abs(one.across - self._began[one.name]) > self.settings.moved

    def _advance(self, own: EgoKinematics) -> None:
        lead = self._lead
        if lead is None or own.speed <= TINY:
            self.phase, self.risk, self._emergency = DriverPhase.CALM, Risk.NONE, False
        elif self.phase is DriverPhase.CALM:
            if self._at_risk(lead):
                self.phase, self._perceived_at = DriverPhase.PERCEIVING, lead.across
                self._left = self.settings.pedestrians if lead.walks else self.settings.evaluation
        elif self.phase is DriverPhase.PERCEIVING:
            self._left -= own.dt
            if self._evaluated(lead):
                self.phase, self._left = DriverPhase.REACTING, REACTION
        elif self.phase is DriverPhase.REACTING:
            self._left -= own.dt
            if not self._dangerous(own, lead):
                self.phase, self.risk = DriverPhase.CALM, Risk.NONE
            elif self._left < TINY:
                self.phase = DriverPhase.BRAKING
        elif not self.settings.full_stop and not self._dangerous(own, lead) and lead.closing < TINY:
            self.phase, self.risk = DriverPhase.CALM, Risk.NONE

    def _at_risk(self, lead: LeadObject) -> bool:
        if self.risk is Risk.CUT_OUT:
            return lead.closing > TINY
        if self.risk is Risk.DECELERATION:
            return lead.change < -HARD
        return self.risk is Risk.CUT_IN and (lead.closing > TINY if lead.walks else self._cuts_in(lead))

    def _evaluated(self, lead: LeadObject) -> bool:
        if self.risk is Risk.CUT_IN and not lead.walks and self.settings.distance is not None:
            return abs(lead.across - self._perceived_at) > self.settings.distance
        return self._left < TINY

    def _dangerous(self, own: EgoKinematics, lead: LeadObject) -> bool:
        if self.settings.always:
            return True
        if self.risk is Risk.CUT_IN:
            return lead.time_to_collision < DANGEROUS
        return lead.headway(own.speed) < DANGEROUS

    def _braking(self, own: EgoKinematics) -> float:
        then = own.acceleration
        if self.phase is DriverPhase.REACTING:
            then = min(then, -RELEASE)
        if self.phase is DriverPhase.BRAKING:
            then -= FULL / JERK_TIME * own.dt
        if self._emergency:
            then -= EMERGENCY / JERK_TIME * own.dt
        return max(then, -EMERGENCY if self._emergency else -FULL)
