"""Rules about entities, their positions, and actions that need a counterpart: traffic to stop, a hitch to connect."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.checks.scenario_rules.outline import Node
from eidrive_scenario.driving.traffic_stations import COMMAND as TRAFFIC_STATIONS
from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.conventions import is_agent_controller
from eidrive_scenario.openscenario.validation.names import scenario_objects


def _objects(context: LintContext) -> Iterator[model.ScenarioObject]:
    """Yield the scenario objects of the file that are not trailers of another entity."""
    entities = context.scenario.document.entities
    for entity, _ in scenario_objects(entities, context.scenario.entries):
        if entity.name in context.scenario.entities and entity.name not in context.trailers:
            yield entity


def _referenced_entities(context: LintContext) -> set[str]:
    names = {member for name in context.referenced.get("entity", set()) for member in context.members(name)}
    return names | context.command_words


def unused_entities(context: LintContext) -> Iterator[Diagnostic]:
    """Yield entities without a reference and without a controller, which may use its entity."""
    referenced = _referenced_entities(context)
    for entity in _objects(context):
        if entity.name not in referenced | context.placed and not entity.object_controller:
            yield at(entity, f"entity {entity.name!r} is never used", "place it with a TeleportAction, or remove it")


def unplaced_entities(context: LintContext) -> Iterator[Diagnostic]:
    """Yield entities that are referenced but never placed."""
    referenced = _referenced_entities(context)
    for entity in _objects(context):
        if entity.name in referenced and entity.name not in context.placed:
            yield at(
                entity,
                f"entity {entity.name!r} is never in the world: no action places it",
                "add a TeleportAction in Init, or an AddEntityAction",
            )


def groups_without_actors(context: LintContext) -> Iterator[Diagnostic]:
    """Yield maneuver groups with private actions and without actors."""
    for node in context.nodes:
        group = node.element
        if not isinstance(group, model.ManeuverGroup) or context.actors(node):
            continue
        acting = [event for event in node.walk() if _has_private_action(event)]
        if not acting:
            continue
        if not group.actors.select_triggering_entities:
            yield at(
                group,
                f"{node.title} has no actors for the private actions of {acting[0].title}",
                "list them in Actors",
            )
        elif node.parent is not None and not _has_entity_condition(node.parent):
            yield at(
                group,
                f"{node.title} selects the triggering entities of {node.parent.title}, "
                "whose start trigger has no ByEntityCondition",
                "list the actors, or start the act by a ByEntityCondition",
            )


def _has_private_action(node: Node) -> bool:
    actions = node.element.action if isinstance(node.element, model.Event) else ()
    return any(isinstance(action, model.Action) and action.private_action is not None for action in actions)


def _has_entity_condition(node: Node) -> bool:
    trigger = node.start
    groups = trigger.condition_group if trigger is not None else ()
    return any(condition.by_entity_condition is not None for group in groups for condition in group.condition)


def zero_wheelbases(context: LintContext) -> Iterator[Diagnostic]:
    """Yield vehicles without a positive wheelbase."""
    for name, entity in context.scenario.entities.items():
        if not isinstance(entity, model.Vehicle):
            continue
        front, rear = entity.axles.front_axle, entity.axles.rear_axle
        if front is not None and front.position_x <= rear.position_x:
            yield at(
                front,
                f"vehicle {name!r} cannot drive by itself: its front axle is at {front.position_x:g} m, "
                f"its rear axle at {rear.position_x:g} m",
                "positionX increases forwards; specify a greater one for the front axle",
            )


def self_references(context: LintContext) -> Iterator[Diagnostic]:
    """Yield distance and synchronization actions that refer to their own actor."""
    for action, actors in context.performances:
        for element in action.walk():
            match element:
                case (
                    model.LateralDistanceAction(entity_ref=other)
                    | model.LongitudinalDistanceAction(entity_ref=other)
                    | model.SynchronizeAction(master_entity_ref=other)
                ) if other in actors:
                    kind = type(element).__name__
                    yield at(element, f"{kind} of {other!r} refers to {other!r} itself", "specify another entity")


def unknown_traffic(context: LintContext) -> Iterator[Diagnostic]:
    """Yield TrafficStopActions with a traffic name that no other action defines."""
    actions = context.of(model.TrafficAction)
    named = [(action, action.traffic_name) for action in actions if action.traffic_name is not None]
    started = {name for action, name in named if action.traffic_stop_action is None}
    for action, name in named:
        if action.traffic_stop_action is not None and name not in started:
            yield at(action, f"TrafficStopAction: no traffic action is named {name!r}", suggestion(name, started))


def traffic_with_stacks(context: LintContext) -> Iterator[Diagnostic]:
    """Yield driving stacks of background traffic, which have no effect."""
    holders: list[model.ControllerDistributionEntry | model.ObjectController]
    holders = [*context.of(model.ControllerDistributionEntry)]
    for template in context.of(model.ScenarioObjectTemplate):
        holders += template.object_controller
    for holder in holders:
        controller: model.Element | None = holder.controller
        if holder.catalog_reference is not None:
            controller = context.scenario.resolved(holder.catalog_reference)
        if isinstance(controller, model.Controller) and is_agent_controller(controller):
            yield at(
                holder,
                f"driving stack {controller.name!r} has no effect: background traffic drives by itself",
                f"make a share of its vehicles stations by the command {TRAFFIC_STATIONS}",
            )


def unconnected_trailers(context: LintContext) -> Iterator[Diagnostic]:
    """Yield ConnectTrailerActions of a vehicle without a hitch or a trailer without a coupler."""
    entities = context.scenario.entities
    for action, actors in context.performances:
        trailer = action.trailer_action
        connect = None if trailer is None else trailer.connect_trailer_action
        if not isinstance(connect, model.ConnectTrailerAction):
            continue
        for name, part in (*((actor, "TrailerHitch") for actor in actors), (connect.trailer_ref, "TrailerCoupler")):
            entity = entities.get(name)
            has_part = isinstance(entity, model.Vehicle) and (
                entity.trailer_hitch if part == "TrailerHitch" else entity.trailer_coupler
            )
            if not has_part:
                message = f"entity {name!r} has no {part}: it is coupled at its reference point"
                yield at(connect, message, f"add a {part}")
