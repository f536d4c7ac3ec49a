"""Automated lane keeping with the performance models of UN Regulation No. 157."""

from __future__ import annotations

from eidrive_behaviors.controllers.adaptive_cruise import SPEED_CHANGE, choice, flag, number
from eidrive_behaviors.controllers.reference_driver import ReferenceDriver, ReferenceDriverSettings
from eidrive_behaviors.controllers.road_ahead import LeadObject, RoadAhead
from eidrive_behaviors.controllers.safety_models import EgoKinematics, Fsm, Regulation, Rss, SafetyModel
from eidrive_scenario.api.actions import Actor, ControllerContext, ControllerModel, model

COMFORT = 2.0
"""Acceleration toward the set speed on a free road [m/s²]."""
FOLLOWING_LIMITS = (-4.0, 3.0)
"""Acceleration limits while following [m/s²]."""
GAINS = (2.0, 1.0)
"""Gains while following: of the speed difference [1/s], of the gap [1/s²]."""
MEMORYLESS: dict[str, type[Regulation | Rss | Fsm]] = {"Regulation": Regulation, "RSS": Rss, "FSM": Fsm}
"""Models other than the ReferenceDriver, by name."""
PERCEIVED_MOTION = {"Dist": 0.72, "Time": None}
"""Lateral motion of a cutting-in vehicle during risk evaluation [m] by `cutInPerceptionDelayMode`; None: by time."""


class AlksDriver(ControllerModel):
    """Lane keeping with braking when one of four models classifies the situation as critical.

    It corresponds to esmini's ALKS_R157SM_Controller. The property `model` selects the model: `Regulation`,
    `ReferenceDriver`, `RSS` or `FSM`. With `cruise` (the default) it returns to the set speed on a free road, and else
    follows by 2 (v_lead - v) + gap - following distance [m/s²], within -4 and 3, which is esmini's law. With the
    property `mode=override` it uses the positions of other entities one step later, as esmini then moves its car after
    them. Further properties: `fullStop`, and for the ReferenceDriver `cutInPerceptionDelayMode` (`Dist`: 0.72 m,
    `Time`: 0.4 s), `pedestrianRiskEvaluationTime` [s], `lateralTrigDistance` [m], `aebTTC` [s], `overlapTolerance` [m],
    `alwaysTrigOnScenario`.
    """

    def __init__(self, controller: model.Controller, context: ControllerContext, actor: Actor) -> None:
        super().__init__(controller, context, actor)
        self._controller = controller
        self.model = self._build_model()
        self._cruises = flag(controller, "cruise", True)
        tolerance = number(controller, "overlapTolerance", 0.1)
        later = context.step if self.properties.get("mode") == "override" else 0.0
        self._road = RoadAhead(context, actor, self.model.reach, tolerance=tolerance, later=later)

    def on_activate(self) -> None:
        """Start from the current speed."""
        self._set = self._last = self.actor.motion.speed
        self._acceleration = 0.0

    def compute_speed(self) -> float:
        """Return the speed by the model [m/s]; if no situation is critical, the set speed or a following speed."""
        now = self.actor.motion.speed
        if abs(now - self._last) > SPEED_CHANGE:
            self._set = now
        ego = EgoKinematics(now, self._acceleration, self.context.dt)
        braking = self.model.decide(ego, self._road.find_lead_objects())
        if braking is not None:
            self._acceleration = braking
            self._last = max(0.0, now + braking * ego.dt)
        else:
            self._acceleration = self._cruise_acceleration(ego, self.model.lead) if self._cruises else 0.0
            self._last = min(max(0.0, now + self._acceleration * ego.dt), max(self._set, 0.0)) if self._cruises else now
        return self._last

    def _cruise_acceleration(self, ego: EgoKinematics, lead: LeadObject | None) -> float:
        if lead is None:
            if abs(ego.speed - self._set) < SPEED_CHANGE:
                return 0.0
            return COMFORT if ego.speed < self._set else -COMFORT
        if ego.speed < SPEED_CHANGE:
            return 0.0
        wanted = -GAINS[0] * lead.closing + GAINS[1] * (lead.gap - self.model.following_distance(ego, lead))
        return min(max(wanted, FOLLOWING_LIMITS[0]), FOLLOWING_LIMITS[1])

    def _build_model(self) -> SafetyModel:
        name = choice(self._controller, "model", ("ReferenceDriver", *MEMORYLESS), "ReferenceDriver")
        full_stop = flag(self._controller, "fullStop", False)
        if name in MEMORYLESS:
            return MEMORYLESS[name](full_stop=full_stop)
        return ReferenceDriver(self._driver_settings(full_stop))

    def _driver_settings(self, full_stop: bool) -> ReferenceDriverSettings:
        controller, default = self._controller, ReferenceDriverSettings()
        return ReferenceDriverSettings(
            pedestrians=number(controller, "pedestrianRiskEvaluationTime", default.pedestrians),
            distance=PERCEIVED_MOTION[choice(controller, "cutInPerceptionDelayMode", PERCEIVED_MOTION, "Dist")],
            moved=number(controller, "lateralTrigDistance", None),
            emergency=number(controller, "aebTTC", default.emergency),
            full_stop=full_stop,
            always=flag(controller, "alwaysTrigOnScenario", False),
        )
