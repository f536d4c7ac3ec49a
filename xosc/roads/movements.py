"""Movements through T-junctions."""

from __future__ import annotations

from dataclasses import replace

from xosc.roads.layout import Arm, Way, movement


def side_road(
    right_of: Arm, left_of: Arm, stem: Arm, *, left_turns: bool = True, right_lanes: int = 1
) -> tuple[Way, ...]:
    """Return the movements of a T-junction: the stem is on the right of traffic from the first arm."""
    ahead = movement(right_of, left_of, "ahead"), replace(movement(left_of, right_of, "ahead"), curb="straight")
    right = right_turn(right_of, stem, right_lanes), right_turn(stem, left_of, right_lanes)
    left = (movement(left_of, stem, "left"), movement(stem, right_of, "left")) if left_turns else ()
    return *ahead, *right, *left


def right_turn(start: Arm, end: Arm, lanes: int) -> Way:
    """Return a right turn from the outermost lanes of one arm."""
    entering, leaving = start.street.driving(start.approach), end.street.driving(-end.approach)
    return movement(start, end, "right", tuple(zip(entering[-lanes:], leaving[-lanes:], strict=True)))
