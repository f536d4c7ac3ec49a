"""Appearance of an actor: lights, animations and visibility."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

FLASH = 0.5
"""Default duration of the on and off phases of a flashing light [s]."""

Color = tuple[float, float, float]


@dataclass(frozen=True)
class LightState:
    """Light of a vehicle: type by the standard, and mode (on, off, flashing).

    since, fade      time of the last switch, and duration of the transition [s]
    on_for, off_for  phases of a flashing light [s]
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
        """Return the brightness at a time [s] in [0, 1], including the fade after a switch."""
        passed = max(time - self.since, 0.0)
        if self.mode == "flashing":
            period = self.on_for + self.off_for
            return 1.0 if period <= 0.0 or (passed + 1e-9) % period < self.on_for else 0.0
        share = 1.0 if self.fade <= 0.0 else min(passed / self.fade, 1.0)
        return share if self.mode == "on" else 1.0 - share


@dataclass(frozen=True)
class AnimationState:
    """Animation of a part of an actor or of its motion.

    kind             component, user component, motion, file or user animation
    what             part, motion or file by its name in the scenario
    state            target state in [0, 1]; None if the scenario omits it
    since, duration  start and duration [s]; None if the scenario omits it
    gestures         gestures of a pedestrian by the standard
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
    """Visibility of an actor. `named` are sensors, by name, with a separate value."""

    graphics: bool = True
    traffic: bool = True
    sensors: bool = True
    named: Mapping[str, bool] = field(default_factory=dict)

    def by(self, sensor: str) -> bool:
        """Return whether the sensor of this name detects the actor."""
        return self.named.get(sensor, self.sensors)


@dataclass(frozen=True)
class Appearance:
    """Lights by type, animations by part, and visibility of an actor."""

    lights: Mapping[str, LightState] = field(default_factory=dict)
    animations: Mapping[str, AnimationState] = field(default_factory=dict)
    visibility: Visibility = field(default_factory=Visibility)

    @property
    def motion(self) -> str:
        """Motion of a pedestrian by the standard; empty if it is not specified."""
        held = self.animations.get("motion")
        return held.what if held is not None else ""


def hidden_actors(appearances: Mapping[str, Appearance]) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]]]:
    """Return the actors that are hidden from sensors in general, and those for sensors with separate values."""
    by_sensor = {
        sensor: tuple(name for name, look in appearances.items() if not look.visibility.by(sensor))
        for sensor in dict.fromkeys(name for look in appearances.values() for name in look.visibility.named)
    }
    return tuple(name for name, look in appearances.items() if not look.visibility.sensors), by_sensor
