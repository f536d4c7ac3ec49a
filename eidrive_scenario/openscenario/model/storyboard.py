"""Storyboard with stories, acts, maneuver groups, maneuvers, events and actions."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.conditions import Trigger
from eidrive_scenario.openscenario.model.declarations import (
    CatalogReference,
    EntityName,
    ParameterDeclarations,
    UnsignedInt,
)
from eidrive_scenario.openscenario.model.element import Choice, Element, child, children
from eidrive_scenario.openscenario.model.entities import EntityRef
from eidrive_scenario.openscenario.model.enumerations import Priority
from eidrive_scenario.openscenario.model.global_actions import GlobalAction, UserDefinedAction
from eidrive_scenario.openscenario.model.private_actions import PrivateAction


class Action(Element, content=Choice(empty_until="1.2")):
    """Named action of an event."""

    name: str
    global_action: GlobalAction | None = None
    user_defined_action: UserDefinedAction | None = None
    private_action: PrivateAction | None = None


class Event(Element):
    """Actions with a common start trigger."""

    name: str
    priority: Priority
    maximum_execution_count: UnsignedInt | None = None
    action: tuple[Action, ...]
    start_trigger: Trigger | None = child(required_until="1.0")


class Maneuver(Element):
    """Group of events."""

    name: str
    parameter_declarations: ParameterDeclarations | None = None
    event: tuple[Event, ...]


class Actors(Element):
    """Actors of a maneuver group."""

    select_triggering_entities: bool
    entity_ref: tuple[EntityRef, ...] = ()


class ManeuverGroup(Element):
    """Maneuvers and their actors."""

    maximum_execution_count: UnsignedInt
    name: str
    actors: Actors
    catalog_reference: tuple[CatalogReference, ...] = ()
    maneuver: tuple[Maneuver, ...] = ()


class Act(Element):
    """Part of a story with start and stop triggers."""

    name: str
    maneuver_group: tuple[ManeuverGroup, ...]
    start_trigger: Trigger | None = child(required_until="1.2")
    stop_trigger: Trigger | None = None


class Story(Element):
    """Group of acts."""

    name: str
    parameter_declarations: ParameterDeclarations | None = None
    act: tuple[Act, ...]


class Private(Element):
    """Initial actions of one entity."""

    entity_ref: EntityName
    private_action: tuple[PrivateAction, ...]


class InitActions(Element):
    """Actions before the start of the run."""

    global_action: tuple[GlobalAction, ...] = ()
    user_defined_action: tuple[UserDefinedAction, ...] = ()
    private: tuple[Private, ...] = ()


class Init(Element):
    """Initialization of the storyboard."""

    actions: InitActions


class Storyboard(Element):
    """Initialization, stories, and stop trigger of the run."""

    init: Init
    story: tuple[Story, ...] = children(required_until="1.1")
    stop_trigger: Trigger | None = child(required_until="1.2")
