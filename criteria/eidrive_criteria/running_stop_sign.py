"""Criterion: crossing of a stop line at a stop sign without a stop."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from eidrive_criteria.stop_lines import StopLineCriterion, StopLineSettings
from eidrive_scenario.api.common import EPSILON, TIME_TOLERANCE
from eidrive_scenario.api.criteria import Crossing, Frame, along, beside

FORGOTTEN = 60.0
"""Distance from a stop line at which a stop before it is forgotten [m]."""
HALF_LANE = 1.75
"""Maximum distance from the center of the lane of a stop that counts [m]."""


class RunningStopSignSettings(StopLineSettings):
    """Settings: `{of: Ego, within: 4.0, below: 0.1, duration: 0}`.

    within    maximum distance of the front before the stop line of a stop that counts [m]
    below     maximum speed of a stop [m/s]
    duration  minimum duration of a stop [s]
    """

    within: Annotated[float, Field(gt=0, le=30)] = 4.0
    below: Annotated[float, Field(gt=0)] = 0.1
    duration: Annotated[float, Field(ge=0)] = 0.0


class RunningStopSign(StopLineCriterion):
    """Criterion that fails if the actor crosses the stop line of a stop sign without a stop before it."""

    settings_type = RunningStopSignSettings
    name = "running_stop_sign"
    kind = "stop sign"
    offense = "did not stop at the stop sign"

    def __init__(self, settings: RunningStopSignSettings) -> None:
        super().__init__(settings)
        self._own = settings
        self._since: dict[str, float] = {}
        """Start of the present stop by signal [s]."""
        self._stopped: dict[str, float] = {}
        """End of the last sufficient stop by signal [s]."""

    def interrupt(self) -> None:
        super().interrupt()
        self._since.clear()
        self._stopped.clear()

    def approach(self, frame: Frame, row: int, point: tuple[float, float]) -> None:
        view, z = frame.view, frame.view.states[row].z
        near = {line.signal for line in self.crossings.near(point, FORGOTTEN, z)}
        self._stopped = {signal: end for signal, end in self._stopped.items() if signal in near}
        stands = abs(float(view.speed[row])) < self._own.below
        if not stands:
            self._since.clear()
            return
        for line in self.crossings.near(point, z=z):
            is_before = -self._own.within - EPSILON <= along(line, point) <= EPSILON
            if is_before and beside(line, point) <= HALF_LANE:
                since = self._since.setdefault(line.signal, view.time)
                if view.time - since >= self._own.duration - TIME_TOLERANCE:
                    self._stopped[line.signal] = view.time

    def is_illegal(self, crossing: Crossing) -> bool:
        return self._stopped.pop(crossing.signal, None) is None
