"""What the storyboard asks of the world, the stations and the channel for the next step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.requests import Goal, Overrides
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment


@dataclass(frozen=True)
class CustomCommand:
    """A CustomCommandAction that started: its type, its text, and where the file says so.

    `scope` holds the parameters that are visible there, if the text refers to any.
    """

    type: str
    content: str
    line: int
    source: str
    scope: Scope | None = None


@dataclass
class Commands:
    """What one tick of the storyboard asks for. Actions write it, the simulation reads it.

    placements   next pose of every scripted actor
    goals        what driven actors shall do; an actor without an entry follows its own settings
    additions    actors that enter the world, and where
    bodies       of those that enter and are no entities of the scenario: background traffic
    removals     actors that leave it
    driven       actors whose own controller is active, lateral and longitudinal
    overrides    controls held per actor, all that are in force
    custom       CustomCommandActions that started in this tick
    environment  what began to hold in this tick, None where nothing changed
    signals      what every traffic signal shows, by its id
    monitors     the values of all monitors
    appearances  how those actors look that differ from the usual
    """

    placements: dict[str, Placement] = field(default_factory=dict)
    goals: dict[str, Goal] = field(default_factory=dict)
    spawns: dict[str, Placement] = field(default_factory=dict)
    actor_specs: dict[str, ActorSpec] = field(default_factory=dict)
    removals: set[str] = field(default_factory=set)
    driven: frozenset[str] = frozenset()
    overrides: Mapping[str, Overrides] = field(default_factory=dict)
    custom: list[CustomCommand] = field(default_factory=list)
    environment: Environment | None = None
    signals: Mapping[str, str] = field(default_factory=dict)
    monitors: Mapping[str, bool] = field(default_factory=dict)
    appearances: Mapping[str, Appearance] = field(default_factory=dict)
