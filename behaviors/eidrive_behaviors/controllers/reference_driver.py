"""Careful and competent human driver of UN Regulation No. 157, Annex 4 Appendix 3."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import ClassVar

from eidrive_behaviors.controllers.road_ahead import LeadObject
from eidrive_behaviors.controllers.safety_models import FULL, JERK_TIME, REACTION, EgoKinematics, G, SafetyModel

TINY = 1e-9
LEAVING_OFFSET = 0.375
"""Distance from the lane center above which a vehicle leaves its lane [m] (Table 1, risk perception point)."""
HARD_BRAKING = 5.0
"""Minimum deceleration of a lead vehicle that is a risk [m/s²] (3.3, deceleration)."""
DANGEROUS = 2.0
"""Dangerous time to collision of a cut-in, or headway in the two other cases [s] (3.1 to 3.3)."""
EMERGENCY = 0.85 * G
"""Full deceleration after full wrap [m/s²] (Table 1; derived from UN Regulation No. 152)."""
RELEASE = 0.4
"""Deceleration when the pedal is released [m/s²] (JRC-FSM)."""


class Risk(Enum):
    """Scenarios of the model."""

    NONE = auto()
    CUT_IN = auto()
    CUT_OUT = auto()
    DECELERATION = auto()


class DriverPhase(Enum):
    """Phase of the driver: no risk, evaluation of a risk, reaction, braking."""

    CALM = auto()
    PERCEIVING = auto()
    REACTING = auto()
    BRAKING = auto()


@dataclass(frozen=True)
class ReferenceDriverSettings:
    """Settings of the driver.

    evaluation    risk evaluation time [s]
    pedestrians   risk evaluation time for pedestrians that walk toward the lane [s]
    distance      lateral motion of a cutting-in vehicle during evaluation, instead of the time [m]; None: by time
    moved         lateral motion at which a cut-in begins [m]; None: 0.375 m from the lane center
    emergency     time to collision below which the car's emergency brake assists after full wrap [s]
    full_stop     True: braking continues until standstill
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
    """Driver that perceives a risk, evaluates it for 0.4 s, reacts after 0.75 s and brakes by 0.774 G within 0.6 s.

    A cut-in is perceived at 0.375 m from the lane center and is dangerous below 2 s to collision. A cut-out that
    reveals another road user, and a lead vehicle that brakes by more than 5 m/s², are dangerous below 2 s of headway.
    After full wrap the emergency brake assists by 0.85 G within 0.6 s; both slopes add up, which the regulation leaves
    open.
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

    def decide(self, ego: EgoKinematics, seen: list[LeadObject]) -> float | None:
        """Return the acceleration of one step [m/s²] after an update of perception, reaction and braking."""
        self._track_approaches(seen)
        self._select_lead(seen)
        self._update_phase(ego)
        lead = self.lead
        if lead is not None and lead.covers and lead.time_to_collision < self.settings.emergency:
            self._emergency = True
        if self.phase is not DriverPhase.BRAKING and not self._emergency:
            return None
        return self._braking(ego)

    def following_distance(self, ego: EgoKinematics, lead: LeadObject) -> float:
        """Return 2 m plus 2 s of the own speed, the headway below which a lead is dangerous [m]."""
        return 2.0 + DANGEROUS * ego.speed

    def _track_approaches(self, seen: list[LeadObject]) -> None:
        """Store the lateral positions at which objects began to move toward the lane."""
        self._began = {other.name: self._began.get(other.name, other.across) for other in seen if other.nearing > TINY}

    def _select_lead(self, seen: list[LeadObject]) -> None:
        held = self.phase is not DriverPhase.CALM and self.settings.full_stop
        if held and self.lead is not None:
            name = self.lead.name
            self.lead = next((other for other in seen if other.name == name), self.lead)
            return
        before = self.lead.name if self.lead is not None else None
        self.lead, risk = self._most_urgent(seen)
        changed = self.lead is not None and (self.lead.name != before or risk is not self.risk)
        if changed and risk is not Risk.NONE:
            self.risk = risk

    def _most_urgent(self, seen: list[LeadObject]) -> tuple[LeadObject | None, Risk]:
        """Return the nearest object that is in the lane or cuts in.

        If it leaves the lane, the object behind it with the smaller time to collision replaces it.
        """
        nearest: LeadObject | None = None
        risk = Risk.NONE
        for other in seen:
            other_risk = self._risk_of(other)
            if other_risk is None:
                continue
            if nearest is None:
                nearest, risk = other, other_risk
            elif risk is Risk.CUT_OUT and other.lanes == 0 and other.time_to_collision < nearest.time_to_collision:
                nearest = other
        return nearest, risk

    def _risk_of(self, other: LeadObject) -> Risk | None:
        """Return the risk of one object; None for an object that stays beside the lane."""
        if other.walks:
            return Risk.CUT_IN if other.nearing > TINY else None
        if other.lanes == 0:
            if abs(other.towards) > LEAVING_OFFSET and other.nearing < -TINY:
                return Risk.CUT_OUT
            return Risk.DECELERATION if other.change < -HARD_BRAKING else Risk.NONE
        return Risk.CUT_IN if self._cuts_in(other) else None

    def _cuts_in(self, other: LeadObject) -> bool:
        if other.name not in self._began:
            return False
        if self.settings.moved is None:
            return other.towards > LEAVING_OFFSET
        return abs(other.across - self._began[other.name]) > self.settings.moved

    def _update_phase(self, ego: EgoKinematics) -> None:
        lead = self.lead
        if lead is None or ego.speed <= TINY:
            self.phase, self.risk, self._emergency = DriverPhase.CALM, Risk.NONE, False
        elif self.phase is DriverPhase.CALM:
            if self._at_risk(lead):
                self.phase, self._perceived_at = DriverPhase.PERCEIVING, lead.across
                self._left = self.settings.pedestrians if lead.walks else self.settings.evaluation
        elif self.phase is DriverPhase.PERCEIVING:
            self._left -= ego.dt
            if self._evaluated(lead):
                self.phase, self._left = DriverPhase.REACTING, REACTION
        elif self.phase is DriverPhase.REACTING:
            self._left -= ego.dt
            if not self._dangerous(ego, lead):
                self.phase, self.risk = DriverPhase.CALM, Risk.NONE
            elif self._left < TINY:
                self.phase = DriverPhase.BRAKING
        elif not self.settings.full_stop and not self._dangerous(ego, lead) and lead.closing < TINY:
            self.phase, self.risk = DriverPhase.CALM, Risk.NONE

    def _at_risk(self, lead: LeadObject) -> bool:
        if self.risk is Risk.CUT_OUT:
            return lead.closing > TINY
        if self.risk is Risk.DECELERATION:
            return lead.change < -HARD_BRAKING
        return self.risk is Risk.CUT_IN and (lead.closing > TINY if lead.walks else self._cuts_in(lead))

    def _evaluated(self, lead: LeadObject) -> bool:
        if self.risk is Risk.CUT_IN and not lead.walks and self.settings.distance is not None:
            return abs(lead.across - self._perceived_at) > self.settings.distance
        return self._left < TINY

    def _dangerous(self, ego: EgoKinematics, lead: LeadObject) -> bool:
        if self.settings.always:
            return True
        if self.risk is Risk.CUT_IN:
            return lead.time_to_collision < DANGEROUS
        return lead.headway(ego.speed) < DANGEROUS

    def _braking(self, ego: EgoKinematics) -> float:
        then = ego.acceleration
        if self.phase is DriverPhase.REACTING:
            then = min(then, -RELEASE)
        if self.phase is DriverPhase.BRAKING:
            then -= FULL / JERK_TIME * ego.dt
        if self._emergency:
            then -= EMERGENCY / JERK_TIME * ego.dt
        return max(then, -EMERGENCY if self._emergency else -FULL)
