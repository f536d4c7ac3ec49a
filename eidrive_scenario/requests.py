"""Requests of a scenario to a driven vehicle: goals, and overrides of its controls.

The storyboard creates them, the driving stack executes them; neither imports the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from eidrive_scenario.arrays import Array
from eidrive_scenario.records import fast_frozen


@fast_frozen
@dataclass(frozen=True)
class Goal:
    """What the storyboard asks of a driven vehicle; None leaves it to the agent's own settings.

    speed      to have now [m/s]
    acceleration  with which that speed is changing [m/s²]
    path       (M, 3) points of a line to drive along, to its end [m], world frame
    lap        (M, 3) points that follow the path's end, again and again [m]; its end is its start
    waypoints  (M, 3) points to pass where there is no path, the last is the destination [m]; the agent finds the way
    """

    speed: float | None = None
    acceleration: float = 0.0
    path: Array | None = None
    waypoints: Array | None = None
    lap: Array | None = None


@dataclass(frozen=True)
class Override:
    """One pedal, the steering wheel or the gear held at a value.

    control   throttle, brake, clutch, parkingBrake, steeringWheel or gear
    value     share of the pedal in [0, 1], angle of the wheel, left positive [rad], or the gear's number
    active    False gives the control back
    max_rate  how fast it may go there [1/s, rad/s]; None at once
    newton    True for a brake whose value is a force [N]
    parked    True for the position P of an automatic transmission
    """

    control: str
    value: float
    active: bool = True
    max_rate: float | None = None
    newton: bool = False
    parked: bool = False


Overrides: TypeAlias = Mapping[str, Override]
"""What is held of one vehicle, by control."""
