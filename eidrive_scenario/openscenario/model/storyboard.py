"""The storyboard: what happens when."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.catalogs import CatalogReference
from eidrive_scenario.openscenario.model.content import Choice
from eidrive_scenario.openscenario.model.declarations import ParameterDeclarations
from eidrive_scenario.openscenario.model.element import Element, child, children
from eidrive_scenario.openscenario.model.entities import EntityRef
from eidrive_scenario.openscenario.model.enumerations import Priority
from eidrive_scenario.openscenario.model.global_actions import GlobalAction, UserDefinedAction
from eidrive_scenario.openscenario.model.private_actions import PrivateAction
from eidrive_scenario.openscenario.model.scalars import EntityName, UnsignedInt
from eidrive_scenario.openscenario.model.triggers import Trigger


@dataclass(frozen=True, kw_only=True)
class Action(Element, content=Choice(empty_until="1.2")):
    """One thing that happens."""

    name: str
    global_action: GlobalAction | None = None
    user_defined_action: UserDefinedAction | None = None
    private_action: PrivateAction | None = None


@dataclass(frozen=True, kw_only=True)
class Event(Element):
    """Actions that start together."""

    name: str
    priority: Priority
    maximum_execution_count: UnsignedInt | None = None
    action: tuple[Action, ...]
    start_trigger: Trigger | None = child(required_until="1.0")


@dataclass(frozen=True, kw_only=True)
class Maneuver(Element):
    """Events that belong together."""

    name: str
    parameter_declarations: ParameterDeclarations | None = None
    event: tuple[Event, ...]


@dataclass(frozen=True, kw_only=True)
class Actors(Element):
    """Who acts."""

    select_triggering_entities: bool
    entity_ref: tuple[EntityRef, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ManeuverGroup(Element):
    """Maneuvers and who acts in them."""

    maximum_execution_count: UnsignedInt
    name: str
    actors: Actors
    catalog_reference: tuple[CatalogReference, ...] = ()
    maneuver: tuple[Maneuver, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Act(Element):
    """A part of a story."""

    name: str
    maneuver_group: tuple[ManeuverGroup, ...]
    start_trigger: Trigger | None = child(required_until="1.2")
    stop_trigger: Trigger | None = None


@dataclass(frozen=True, kw_only=True)
class Story(Element):
    """Acts that belong together."""

    name: str
    parameter_declarations: ParameterDeclarations | None = None
    act: tuple[Act, ...]


@dataclass(frozen=True, kw_only=True)
class Private(Element):
    """What one entity does before the run starts."""

    entity_ref: EntityName
    private_action: tuple[PrivateAction, ...]


@dataclass(frozen=True, kw_only=True)
class InitActions(Element):
    """What happens before the run starts."""

    global_action: tuple[GlobalAction, ...] = ()
    user_defined_action: tuple[UserDefinedAction, ...] = ()
    private: tuple[Private, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Init(Element):
    """The state at the start."""

    actions: InitActions


@dataclass(frozen=True, kw_only=True)
class Storyboard(Element):
    """Initial state, stories, and when the run ends."""

    init: Init
    story: tuple[Story, ...] = children(required_until="1.1")
    stop_trigger: Trigger | None = child(required_until="1.2")
