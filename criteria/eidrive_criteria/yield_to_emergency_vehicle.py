"""Criterion: giving way to an emergency vehicle from behind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from eidrive_criteria.folds import exceeds, require_two_actors
from eidrive_criteria.pairs import SurroundedCriterion
from eidrive_scenario.api.criteria import CriterionSettings, Frame, Verdict, actor_never_present


class YieldToEmergencyVehicleSettings(CriterionSettings):
    """Settings: `{of: Ego, to: Ambulance, within: 50, at_most: 15}` with distance [m] and time [s].

    within   gap from which on an emergency vehicle behind has to be let past [m]
    at_most  maximum time until it is past [s]; None: until the end of the run
    """

    of: str
    to: str
    within: Annotated[float, Field(gt=0, le=200)] = 50.0
    at_most: Annotated[float, Field(gt=0)] | None = None

    _two_actors = model_validator(mode="after")(require_two_actors)


class YieldToEmergencyVehicle(SurroundedCriterion):
    """Criterion that fails if an emergency vehicle that approaches from behind does not get past the actor.

    It approaches when it drives in the direction of the actor, at most `within` behind it, in any lane. The approach
    ends when its center is ahead of that of the actor, or when it takes another way. It continues if the vehicle falls
    farther behind or either of both is removed.
    """

    settings_type = YieldToEmergencyVehicleSettings
    name = "yield_to_emergency_vehicle"
    unit = "s"

    def __init__(self, settings: YieldToEmergencyVehicleSettings) -> None:
        super().__init__(settings, settings.of, settings.to)
        self._settings = settings
        self._since: float | None = None
        """Start of the present approach [s]; None without one."""
        self._longest: float | None = None
        """Longest time from the start of an approach until the emergency vehicle was past, or until now [s]."""
        self._violated: float | None = None
        self._gap = 0.0
        """Last gap to the emergency vehicle during the present approach [m]."""
        self._outcome = ""
        """Description of the end of the last approach."""
        self._removed = False
        """Whether either of both is absent since the present approach."""

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        if self.missing:
            self.missing.difference_update(view.names)
        self._removed = not (settings.of in view.rows and settings.to in view.rows)
        if self._removed:
            return
        relation = next(self.surroundings.relations(view, settings.of, self.others), None)
        if self._since is None:
            approaches = (
                relation is not None
                and relation.ahead <= 0.0 < relation.other_speed
                and relation.gap <= settings.within
            )
            self._since = view.time if approaches else None
        if self._since is None:
            return
        waited = view.time - self._since
        self._longest = waited if self._longest is None else max(self._longest, waited)
        if self._violated is None and exceeds(waited, settings.at_most):
            self._violated = view.time
        if relation is None:
            # Without a relation a vehicle that had fallen back is out of range; a near one is on another way.
            if self._gap <= settings.within:
                self._since, self._outcome = None, "took another way than"
            return
        self._gap = relation.gap
        if relation.ahead > 0.0:
            self._since, self._outcome = None, "was past"

    def verdict(self) -> Verdict:
        settings = self._settings
        of, to = settings.of, settings.to
        if self.missing:
            reason = actor_never_present(self.missing)
        elif self._longest is None:
            reason = f"{to} never approached {of} from behind within {settings.within:g} m"
        elif self._since is not None:
            reason = f"{to} was still behind {of}, {self._longest:.2f} s after it had approached"
            reason += ", when one of both was removed" if self._removed else ""
        else:
            reason = f"{to} {self._outcome} {of} {self._longest:.2f} s after it had approached"
        return self.conclude(
            not self.missing and self._since is None and self._violated is None,
            reason,
            value=self._longest,
            limit=settings.at_most,
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the longest time until the emergency vehicle was past [s]; empty without an approach."""
        return {} if self._longest is None else {f"{self.name}.{self._settings.of}": self._longest}
