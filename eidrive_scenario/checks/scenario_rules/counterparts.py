"""Rules on actions that need a partner: traffic that nobody starts, trailers that nothing holds."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.checks.rule import at
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.openscenario.model import ConnectTrailerAction, TrafficAction, Vehicle


def unknown_traffic(context: LintContext) -> Iterator[Diagnostic]:
    """A TrafficStopAction for traffic of a name that no action gives."""
    actions = [element for element in context.elements if isinstance(element, TrafficAction)]
    started = {one.traffic_name for one in actions if one.traffic_stop_action is None and one.traffic_name is not None}
    for one in actions:
        if one.traffic_stop_action is not None and one.traffic_name is not None and one.traffic_name not in started:
            yield at(one, f"no traffic has the name {one.traffic_name!r}", suggestion(one.traffic_name, started))


def unconnected_trailers(context: LintContext) -> Iterator[Diagnostic]:
    """A ConnectTrailerAction where the vehicle has no hitch, or the trailer no coupler."""
    bodies = context.scenario.entities
    for action, actors in context.performances:
        trailer = action.trailer_action
        connect = None if trailer is None else trailer.connect_trailer_action
        if not isinstance(connect, ConnectTrailerAction):
            continue
        for name, part in (*((actor, "TrailerHitch") for actor in actors), (connect.trailer_ref, "TrailerCoupler")):
            body = bodies.get(name)
            held = isinstance(body, Vehicle) and (
                body.trailer_hitch if part == "TrailerHitch" else body.trailer_coupler
            )
            if not held:
                yield at(connect, f"{name!r} has no {part}: it is coupled at its reference point", f"give it a {part}")
