"""Drivers for tests of automated lane keeping: the performance models of UN Regulation No. 157 at the wheel."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_behaviors.controllers.properties import number
from eidrive_behaviors.controllers.reference_driver import ReferenceDriver, ReferenceDriverSettings
from eidrive_behaviors.controllers.road_ahead import LeadObject, RoadAhead
from eidrive_behaviors.controllers.safety_models import EgoKinematics, Fsm, Regulation, Rss, SafetyModel
from eidrive_scenario.api.actions import Actor, ControllerModel, RuntimeContext, model
from eidrive_scenario.api.common import Diagnostic, ScenarioError, suggestion

COMFORT = 2.0
"""Back to the set speed on a free road [m/s²]."""
STRONGEST = (-4.0, 3.0)
"""Of following somebody [m/s²]."""
GAINS = (2.0, 1.0)
"""Of following: by difference of speed [1/s], by gap [1/s²]."""
OVERRULED = 1e-3
"""A speed that differs by more than this was set by somebody else [m/s]."""
MODELS = ("Regulation", "ReferenceDriver", "RSS", "FSM")


class AlksDriver(ControllerModel):
    """Keeps its lane, and brakes where one of four models says that the situation is critical.

    It plays esmini's ALKS_R157SM_Controller, by whose property `model` it is told which one: `Regulation`,
    `ReferenceDriver`, `RSS` or `FSM`. With `cruise` (the default) it returns to the set speed on a free road, and else
    follows by 2 (v_lead - v) + gap - following distance [m/s²], within -4 and 3, which is esmini's law. With the
    property `mode=override` it sees the others where they are a step later, as esmini then moves its car after them.
    Further properties: `fullStop`, and for the ReferenceDriver `cutInPerceptionDelayMode` (`Dist`: 0.72 m, `Time`:
    0.4 s), `pedestrianRiskEvaluationTime` [s], `lateralTrigDistance` [m], `aebTTC` [s], `overlapTolerance` [m],
    `alwaysTrigOnScenario`.
    """

    def __init__(self, controller: model.Controller, context: RuntimeContext, actor: Actor) -> None:
        super().__init__(controller, context, actor)
        self._controller = controller
        self.model = self._chosen()
        self._cruises = self._says("cruise", True)
        slack = number(controller, "overlapTolerance", 0.1)
        later = context.step if self.properties.get("mode") == "override" else 0.0
        self._road = RoadAhead(context, actor, self.model.reach, tolerance=slack, later=later)

    def on_activate(self) -> None:
        """Drive on with the speed of now."""
        self._set = self._last = self.actor.motion.speed
        self._acceleration = 0.0

    def compute_speed(self) -> float:
        """By the model; where nothing is critical the set speed, or behind who is ahead."""
        now = self.actor.motion.speed
        if abs(now - self._last) > OVERRULED:
            self._set = now
        own = EgoKinematics(now, self._acceleration, self.context.dt)
        braking = self.model.decide(own, self._road.find_lead_objects())
        if braking is not None:
            self._acceleration = braking
            self._last = max(0.0, now + braking * own.dt)
        else:
            self._acceleration = self._cruising(own, self.model.lead) if self._cruises else 0.0
            self._last = min(max(0.0, now + self._acceleration * own.dt), max(self._set, 0.0)) if self._cruises else now
        return self._last

    def _cruising(self, own: EgoKinematics, lead: LeadObject | None) -> float:
        if lead is None:
            if abs(own.speed - self._set) < OVERRULED:
                return 0.0
            return COMFORT if own.speed < self._set else -COMFORT
        if own.speed < OVERRULED:
            return 0.0
        wanted = -GAINS[0] * lead.closing + GAINS[1] * (lead.gap - self.model.following_distance(own, lead))
        return min(max(wanted, STRONGEST[0]), STRONGEST[1])

    def _chosen(self) -> SafetyModel:
        full_stop = self._says("fullStop", False)
        name = self.properties.get("model", "ReferenceDriver")
        if name == "ReferenceDriver":
            return ReferenceDriver(self._driver(full_stop))
        memoryless: dict[str, type[Regulation | Rss | Fsm]] = {"Regulation": Regulation, "RSS": Rss, "FSM": Fsm}
        if name not in memoryless:
            raise self._diagnostic(f"knows no model {name!r}", suggestion(name, MODELS))
        return memoryless[name](full_stop=full_stop)

    def _driver(self, full_stop: bool) -> ReferenceDriverSettings:
        usual = ReferenceDriverSettings()
        mode = self.properties.get("cutInPerceptionDelayMode", "Dist")
        if mode not in ("Dist", "Time"):
            raise self._diagnostic(f"knows no cutInPerceptionDelayMode {mode!r}", suggestion(mode, ("Dist", "Time")))
        return ReferenceDriverSettings(
            pedestrians=number(self._controller, "pedestrianRiskEvaluationTime", usual.pedestrians),
            distance=0.72 if mode == "Dist" else None,
            moved=number(self._controller, "lateralTrigDistance", None),
            emergency=number(self._controller, "aebTTC", usual.emergency),
            full_stop=full_stop,
            always=self._says("alwaysTrigOnScenario", False),
        )

    def _says(self, name: str, usual: bool) -> bool:
        text = self.properties.get(name)
        return usual if text is None else _TRUTH.get(text.strip().lower(), usual)

    def _diagnostic(self, message: str, hint: str) -> ScenarioError:
        here = self._controller
        return ScenarioError(Diagnostic(f"the controller {here.name!r} {message}", hint, here.source, here.line))


_TRUTH: Mapping[str, bool] = {"true": True, "1": True, "false": False, "0": False}
