"""How an actor looks beside its body and pose: its lights, what moves on it, and who sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

FLASH = 0.5
"""How long a flashing light is on, and off, where nobody says so [s]."""

Color = tuple[float, float, float]


@dataclass(frozen=True)
class LightState:
    """A light of a vehicle: its type (as the standard names it) and mode (on, off, flashing).

    since, fade    when it was switched, and how long the switching takes [s]
    on_for, off_for  of a flashing light [s]
    """

    light: str
    mode: str
    intensity: float | None = None
    """Luminous intensity [cd]."""
    color: Color | None = None
    """Red, green, blue in [0, 1]."""
    since: float = 0.0
    fade: float = 0.0
    on_for: float = FLASH
    off_for: float = FLASH

    def brightness(self, time: float) -> float:
        """How bright it is at a time [s], in [0, 1]; switched from dark to bright or back over its fade."""
        passed = max(time - self.since, 0.0)
        if self.mode == "flashing":
            period = self.on_for + self.off_for
            return 1.0 if period <= 0.0 or (passed + 1e-9) % period < self.on_for else 0.0
        share = 1.0 if self.fade <= 0.0 else min(passed / self.fade, 1.0)
        return share if self.mode == "on" else 1.0 - share


@dataclass(frozen=True)
class AnimationState:
    """Something that moves on an actor, or how it moves.

    kind   component, user component, motion, file or user animation
    what   the part, the motion or the file, as the scenario names it
    state  how far it has to go, in [0, 1]; None if the scenario does not say
    since, duration  when it began, and how long it takes [s]; None if the scenario does not say
    gestures  of a pedestrian, as the standard names them
    """

    kind: str
    what: str
    state: float | None = None
    since: float = 0.0
    duration: float | None = None
    loop: bool = False
    gestures: tuple[str, ...] = ()


@dataclass(frozen=True)
class Visibility:
    """Who can see an actor; `named` are the sensors, by their names, for which something else was said."""

    graphics: bool = True
    traffic: bool = True
    sensors: bool = True
    named: Mapping[str, bool] = field(default_factory=dict)

    def by(self, sensor: str) -> bool:
        """Return whether the sensor of this name sees it."""
        return self.named.get(sensor, self.sensors)


@dataclass(frozen=True)
class Appearance:
    """All of it: lights by type, animations by the part that moves, and who sees the actor."""

    lights: Mapping[str, LightState] = field(default_factory=dict)
    animations: Mapping[str, AnimationState] = field(default_factory=dict)
    visibility: Visibility = field(default_factory=Visibility)

    @property
    def motion(self) -> str:
        """The motion of a pedestrian, as the standard names it; empty where nobody has said."""
        held = self.animations.get("motion")
        return held.what if held is not None else ""
