"""Rules about actions that need a counterpart: traffic to stop, a hitch or coupler to connect."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.openscenario.model import ConnectTrailerAction, TrafficAction, Vehicle


def unknown_traffic(context: LintContext) -> Iterator[Diagnostic]:
    """Yield TrafficStopActions with a traffic name that no other action defines."""
    actions = [element for element in context.elements if isinstance(element, TrafficAction)]
    started = {one.traffic_name for one in actions if one.traffic_stop_action is None and one.traffic_name is not None}
    for one in actions:
        if one.traffic_stop_action is not None and one.traffic_name is not None and one.traffic_name not in started:
            message = f"TrafficStopAction: no traffic action is named {one.traffic_name!r}"
            yield at(one, message, suggestion(one.traffic_name, started))


def unconnected_trailers(context: LintContext) -> Iterator[Diagnostic]:
    """Yield ConnectTrailerActions of a vehicle without a hitch or a trailer without a coupler."""
    entities = context.scenario.entities
    for action, actors in context.performances:
        trailer = action.trailer_action
        connect = None if trailer is None else trailer.connect_trailer_action
        if not isinstance(connect, ConnectTrailerAction):
            continue
        for name, part in (*((actor, "TrailerHitch") for actor in actors), (connect.trailer_ref, "TrailerCoupler")):
            entity = entities.get(name)
            has_part = isinstance(entity, Vehicle) and (
                entity.trailer_hitch if part == "TrailerHitch" else entity.trailer_coupler
            )
            if not has_part:
                message = f"entity {name!r} has no {part}: it is coupled at its reference point"
                yield at(connect, message, f"add a {part}")
