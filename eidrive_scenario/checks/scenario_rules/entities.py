"""Rules on entities: who is never there, who is never spoken of, groups in which nobody acts."""

from __future__ import annotations

import re
from collections.abc import Iterator

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.checks.scenario_rules.outline import Node
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario.model import (
    Action,
    CustomCommandAction,
    Event,
    LateralDistanceAction,
    LongitudinalDistanceAction,
    ManeuverGroup,
    ScenarioObject,
    SynchronizeAction,
    Vehicle,
)
from eidrive_scenario.openscenario.validation.scenario_objects import scenario_objects

_WORD = re.compile(r"\w+")


def _objects(context: LintContext) -> Iterator[ScenarioObject]:
    """The scenario objects that stand in the file for an entity of their own."""
    entities = context.scenario.document.entities
    for one, _ in scenario_objects(entities, context.scenario.entries):
        if one.name in context.scenario.entities and one.name not in context.trailers:
            yield one


def _spoken_of(context: LintContext) -> set[str]:
    names = {one for name in context.named.get("entity", set()) for one in context.members(name)}
    commands = [one.content for one in context.elements if isinstance(one, CustomCommandAction)]
    return names | {word for text in commands for word in _WORD.findall(text)}


def unused_entities(context: LintContext) -> Iterator[Diagnostic]:
    """An entity that is declared, and then never spoken of; what has a controller may be known to that."""
    spoken_of = _spoken_of(context)
    for one in _objects(context):
        if one.name not in spoken_of | context.placed and not one.object_controller:
            yield at(one, f"the entity {one.name!r} is never used", "place it with a TeleportAction, or take it out")


def never_placed(context: LintContext) -> Iterator[Diagnostic]:
    """An entity that acts or is asked about, but is nowhere."""
    spoken_of = _spoken_of(context)
    for one in _objects(context):
        if one.name in spoken_of and one.name not in context.placed:
            yield at(
                one,
                f"the entity {one.name!r} is never placed, so it is not in the world",
                "give it a TeleportAction in Init, or an AddEntityAction",
            )


def groups_without_actors(context: LintContext) -> Iterator[Diagnostic]:
    """Private actions for which there is nobody."""
    for node in context.nodes:
        group = node.element
        if not isinstance(group, ManeuverGroup) or context.actors(node):
            continue
        acting = [event for event in node.walk() if _acts(event)]
        if not acting:
            continue
        if not group.actors.select_triggering_entities:
            yield at(
                group,
                f"{node.title} has no actors, so nobody does what is private in {acting[0].title}",
                "name them in Actors",
            )
        elif node.parent is not None and not _about_entities(node.parent):
            yield at(
                group,
                f"{node.title} is for those who trigger {node.parent.title}, whose start trigger asks about nobody",
                "name the actors, or start the act by a ByEntityCondition",
            )


def _acts(node: Node) -> bool:
    actions = node.element.action if isinstance(node.element, Event) else ()
    return any(isinstance(action, Action) and action.private_action is not None for action in actions)


def _about_entities(node: Node) -> bool:
    trigger = node.start
    groups = trigger.condition_group if trigger is not None else ()
    return any(condition.by_entity_condition is not None for group in groups for condition in group.condition)


def axles_not_apart(context: LintContext) -> Iterator[Diagnostic]:
    """A vehicle whose front axle is not ahead of the rear axle: it has no wheelbase to drive on."""
    for name, body in context.scenario.entities.items():
        front = body.axles.front_axle if isinstance(body, Vehicle) else None
        if isinstance(body, Vehicle) and front is not None and front.position_x <= body.axles.rear_axle.position_x:
            yield at(
                front,
                f"the front axle of {name!r} is at {front.position_x:g} m, the rear axle at "
                f"{body.axles.rear_axle.position_x:g} m: it cannot drive by itself",
                "positionX counts forwards; the front axle has the greater one",
            )


def relations_to_oneself(context: LintContext) -> Iterator[Diagnostic]:
    """An action that keeps an entity at a distance from itself, or synchronizes it with itself."""
    for action, actors in context.performances:
        for element in action.walk():
            if isinstance(element, LateralDistanceAction | LongitudinalDistanceAction):
                other = element.entity_ref
            elif isinstance(element, SynchronizeAction):
                other = element.master_entity_ref
            else:
                continue
            if other in actors:
                kind = type(element).__name__
                yield at(element, f"{kind} of {other!r} refers to {other!r} itself", "name another entity")
