"""Minimum distances of Responsibility-Sensitive Safety (Shalev-Shwartz et al., arXiv 1708.06374, section 3)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SafeDistanceModel:
    """Parameters of the minimum distances; the defaults are those of the ego vehicle in CARLA (`RssCheck.cpp`).

    reaction_time              time before the response [s]
    max_acceleration           during the reaction time [m/s²]
    min_braking, max_braking   deceleration of the responding and of the leading actor [m/s²]
    min_braking_correct        deceleration of an actor that meets another one in its own lane [m/s²]
    lateral_acceleration, lateral_braking   lateral counterparts [m/s²]
    lateral_margin             lateral distance that always remains [m]
    """

    reaction_time: float = 1.0
    max_acceleration: float = 3.5
    min_braking: float = 4.0
    max_braking: float = 8.0
    min_braking_correct: float = 3.0
    lateral_acceleration: float = 0.2
    lateral_braking: float = 0.8
    lateral_margin: float = 0.1

    def same_direction(self, rear: float, front: float) -> float:
        """Return the minimum gap of an actor with speed `rear` behind one with speed `front` [m]."""
        distance = self._reaction(rear) + self._after(rear) ** 2 / (2.0 * self.min_braking)
        return max(distance - front * front / (2.0 * self.max_braking), 0.0)

    def opposite(self, in_own_lane: float, against: float) -> float:
        """Return the minimum gap of an actor in its own lane and one against it [m]; speeds of at least 0."""
        first = self._reaction(in_own_lane) + self._after(in_own_lane) ** 2 / (2.0 * self.min_braking_correct)
        return first + self._reaction(against) + self._after(against) ** 2 / (2.0 * self.min_braking)

    def longest(self, own: float, fastest: float) -> float:
        """Return the largest minimum gap [m] of an actor with speed `own` to any other, with speed up to `fastest`."""
        opposite = max(self.opposite(own, fastest), self.opposite(fastest, own))
        return max(self.same_direction(own, 0.0), opposite)

    def lateral(self, left: float, right: float) -> float:
        """Return the minimum lateral distance of a left and a right actor [m]; speeds are positive to the right."""
        rho, gain, braking = self.reaction_time, self.lateral_acceleration, self.lateral_braking
        after_left, after_right = left + rho * gain, right - rho * gain
        reach_left = (left + after_left) / 2.0 * rho + after_left * abs(after_left) / (2.0 * braking)
        reach_right = (right + after_right) / 2.0 * rho + after_right * abs(after_right) / (2.0 * braking)
        return self.lateral_margin + max(reach_left - reach_right, 0.0)

    def _after(self, speed: float) -> float:
        return speed + self.reaction_time * self.max_acceleration

    def _reaction(self, speed: float) -> float:
        return (speed + self._after(speed)) / 2.0 * self.reaction_time
