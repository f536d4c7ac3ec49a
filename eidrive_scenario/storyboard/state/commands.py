"""Inputs of a run from outside the scenario, and commands of the storyboard to world, stations and channel."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, Never

import msgspec

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.requests import Goal, Overrides
from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario.model import Element
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.roads import Pose
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment

NONE: Mapping[str, Never] = MappingProxyType({})
"""No entries."""


@dataclass(frozen=True)
class CustomCommand:
    """Started CustomCommandAction: its type, its content, and its line in the file.

    `scope` holds the parameters that are visible at that line; None if the content refers to none.
    """

    type: str
    content: str
    line: int
    source: str
    scope: Scope | None = None


class Commands(msgspec.Struct):
    """Commands of one tick of the storyboard. The context writes them, the simulation executes them.

    placements   next pose of each scripted actor; one without it stands
    goals        requests to driven actors; an actor without an entry follows its own settings
    spawns       placements of the actors that enter the world
    actor_specs  bodies of entering actors whose body does not follow from an entity, such as background traffic
    removals     actors that leave the world
    trailers     trailer of each towing vehicle, by name
    driven       actors whose own controller is active, lateral and longitudinal
    overrides    controls that are held, by actor
    custom       CustomCommandActions that started in this tick
    environment  environment that was set in this tick, None without a change
    signals      state of every traffic signal, by id
    monitors     values of all monitors
    routes       points (M, 3) of the routes that were requested in this tick, by actor [m]
    appearances  appearances of the actors that differ from the default
    """

    placements: dict[str, Placement] = msgspec.field(default_factory=dict)
    goals: dict[str, Goal] = msgspec.field(default_factory=dict)
    spawns: dict[str, Placement] = msgspec.field(default_factory=dict)
    actor_specs: dict[str, ActorSpec] = msgspec.field(default_factory=dict)
    removals: set[str] = msgspec.field(default_factory=set)
    trailers: Mapping[str, str] = NONE
    driven: frozenset[str] = frozenset()
    overrides: Mapping[str, Overrides] = NONE
    custom: list[CustomCommand] = msgspec.field(default_factory=list)
    environment: Environment | None = None
    signals: Mapping[str, str] = NONE
    monitors: Mapping[str, bool] = NONE
    routes: Mapping[str, Array] = NONE
    appearances: Mapping[str, Appearance] = NONE


class ExternalPose(NamedTuple):
    """Pose of an entity at the end of the step, and its speed along its heading [m/s]."""

    pose: Pose
    speed: float


def user_value_warnings(
    requested: Mapping[str, Element], given: Collection[str], settings: Collection[str]
) -> Iterator[str]:
    """Yield a warning for each requested value without a setting, and for each setting that no condition reads.

    requested  first element that requests each value, by the name of the value
    given      names of the values that are set in the run
    settings   names of the values that the settings of the run set
    """
    for name, element in requested.items():
        if name not in given:
            where = f"{element.source}:{element.line}"
            effect = f"UserDefinedValueCondition {name!r} is never fulfilled: no value is set"
            yield f"{where}: {effect}; use RunSettings.user_values {name}=VALUE or set_user_value"
    for name in settings:
        if name not in requested:
            message = f"RunSettings.user_values {name}: no UserDefinedValueCondition reads the value"
            yield f"{message}; {suggestion(name, requested)}"
