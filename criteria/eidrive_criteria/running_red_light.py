"""Criterion: crossing of a stop line at a red light."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_criteria.stop_lines import StopLineCriterion, StopLineSettings
from eidrive_scenario.api.common import RoadNetwork
from eidrive_scenario.api.criteria import Crossing, Frame, lamp_colors, shows_red


class RunningRedLightSettings(StopLineSettings):
    """Settings: `{of: Ego, part: front}`; `part: rear` also fails an actor whose rear crosses after the change."""


class RunningRedLight(StopLineCriterion):
    """Criterion that fails if the actor crosses the stop line of a traffic light that shows red.

    The state in the frame before the crossing counts. A light whose state the scenario never sets shows nothing. The
    light of a connecting road counts at the line if the route of the actor takes this road, or if all connecting roads
    of its lane show red, otherwise once the actor has taken this road.
    """

    settings_type = RunningRedLightSettings
    name = "running_red_light"
    kind = "light"
    offense = "ran the red light"

    def __init__(self, settings: RunningRedLightSettings) -> None:
        super().__init__(settings)
        self._colors: Mapping[str, tuple[str, ...]] = {}
        self._red: list[tuple[float, frozenset[str]]] = []
        """Times of all changes and the lights that show red from then on: a crossing may be decided much later."""

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        if roads is not None:
            self._colors = {line.signal: lamp_colors(roads.signals[line.signal]) for line in self.crossings.lines}

    def observe(self, frame: Frame) -> None:
        if self.of in frame.routes:
            self.crossings.set_route(frame.routes[self.of])
        super().observe(frame)

    def approach(self, frame: Frame, row: int, point: tuple[float, float]) -> None:
        violation = self.crossings.decide_at_line(frame.view.time, self.is_illegal)
        if violation is not None:
            self._passed += 1
            self._illegal.append(violation)
        signals, colors = frame.signals, self._colors
        red = frozenset(name for name, state in signals.items() if name in colors and shows_red(state, colors[name]))
        if not self._red or self._red[-1][1] != red:
            self._red.append((frame.view.time, red))

    def is_illegal(self, crossing: Crossing) -> bool:
        before = [red for time, red in self._red if time < crossing.time]
        return bool(before) and crossing.signal in before[-1]
