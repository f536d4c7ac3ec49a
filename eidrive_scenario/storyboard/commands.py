"""What the storyboard asks of the world, the stations and the channel for the next step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from eidrive_scenario.driving.step import Goal
from eidrive_scenario.openscenario import model
from eidrive_scenario.world.actor import Placement


@dataclass(frozen=True)
class CustomCommand:
    """A CustomCommandAction that started: its type, its text, and where the file says so."""

    type: str
    content: str
    line: int
    source: str


@dataclass(frozen=True)
class Override:
    """One pedal or the steering wheel held at a value.

    control  throttle, brake, clutch, parkingBrake, steeringWheel or gear
    value    share of the pedal in [0, 1], angle of the wheel [rad], or the gear's number
    active   False gives the control back
    """

    control: str
    value: float
    active: bool = True


@dataclass(frozen=True)
class Visibility:
    """Who can see an entity."""

    graphics: bool = True
    traffic: bool = True
    sensors: bool = True


@dataclass(frozen=True)
class LightState:
    """A light of a vehicle: its type (as the standard names it) and mode (on, off, flashing)."""

    light: str
    mode: str
    intensity: float | None = None
    """Luminous intensity [cd]."""


Overrides: TypeAlias = dict[str, dict[str, Override]]


@dataclass
class Commands:
    """What one tick of the storyboard asks for. Actions write it, the simulation reads it.

    placements   next pose of every scripted actor
    goals        what driven actors shall do; an actor without an entry follows its own settings
    additions    actors that enter the world, and where
    removals     actors that leave it
    driven       actors whose own controller is active, lateral and longitudinal
    overrides    controls held per actor, all that are in force
    custom       CustomCommandActions that started in this tick
    environment  the Environment that began to hold in this tick
    signals      new states of traffic signals, by their id
    lights, visibility  per actor, where they changed
    """

    placements: dict[str, Placement] = field(default_factory=dict)
    goals: dict[str, Goal] = field(default_factory=dict)
    additions: dict[str, Placement] = field(default_factory=dict)
    removals: set[str] = field(default_factory=set)
    driven: frozenset[str] = frozenset()
    overrides: Mapping[str, Mapping[str, Override]] = field(default_factory=dict)
    custom: list[CustomCommand] = field(default_factory=list)
    environment: model.Environment | None = None
    signals: dict[str, str] = field(default_factory=dict)
    lights: dict[str, list[LightState]] = field(default_factory=dict)
    visibility: dict[str, Visibility] = field(default_factory=dict)
