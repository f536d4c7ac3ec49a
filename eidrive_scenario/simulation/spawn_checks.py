"""Check of the places at which vehicles start: inside of another body, or off the road."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from eidrive_scenario.driving.station_warnings import MARGIN
from eidrive_scenario.errors import MAX_DIAGNOSTICS, Diagnostic, SettingError, quoted
from eidrive_scenario.geometry import overlap
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import Element
from eidrive_scenario.openscenario.scenario import EntitySelections
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.kinematics.trailers import declared_trailer
from eidrive_scenario.world import World
from eidrive_scenario.world.view import WorldView

MOST_OTHERS = 20
"""Maximum number of further actors that are counted for each one that starts inside of another."""
_TOUCH = 0.02
"""Depth up to which two bodies touch, but do not overlap [m]."""
_LOW = 0.2
"""Height up to which a vehicle drives over an object [m]."""


def check_spawns(scenario: Scenario, roads: RoadNetwork | None, world: World, drivers: Collection[str]) -> None:
    """Raise SettingError with every vehicle that drives itself and starts inside of another actor or off the road.

    world    state after Init
    drivers  vehicles that a driving stack drives
    """
    if not drivers:
        return
    view = world.poses()
    present = [name for name in scenario.entities if name in view.rows and name in drivers]
    found = [*overlapping_spawns(scenario, view, present), *_off_road(scenario, roads, view, present)]
    if found:
        raise SettingError(found)


def overlapping_spawns(
    scenario: Scenario, view: WorldView, names: Collection[str], among: Collection[str] | None = None
) -> Iterator[Diagnostic]:
    """Yield those of these actors that overlap another one; a pair of them is one diagnostic.

    Vehicle and trailers of a train do not count. `among` limits the other actors; None: all that are present. The
    number of diagnostics and of the others in each is limited: of actors at one place, all pairs overlap.
    """
    present = [name for name in scenario.entities if name in view.rows and (among is None or name in among)]
    boxes = {name: _core(view.plain_boxes[view.rows[name]]) for name in present}
    table = np.reshape([boxes[name] for name in present], (-1, 7))
    cos, sin = np.abs(np.cos(table[:, 6])), np.abs(np.sin(table[:, 6]))
    reach_x = (table[:, 3] * cos + table[:, 4] * sin + _TOUCH) / 2.0
    reach_y = (table[:, 3] * sin + table[:, 4] * cos + _TOUCH) / 2.0
    rows = {name: row for row, name in enumerate(present)}
    trains = _trains(scenario)
    done: set[str] = set()
    yielded = 0
    for name in names:
        done.add(name)
        train, row = trains.get(name, name), rows[name]
        apart = np.abs(table[:, :2] - table[row, :2])
        is_far = (apart[:, 0] > reach_x + reach_x[row]) | (apart[:, 1] > reach_y + reach_y[row])
        candidates = (other for other in map(present.__getitem__, (~is_far).nonzero()[0]) if other not in done)
        overlapping = (
            other for other in candidates if trains.get(other, other) != train and overlap(boxes[name], boxes[other])
        )
        others = list(islice(overlapping, MOST_OTHERS + 2))
        if others:
            x, y, *_ = boxes[others[0]]
            count = f"{len(others) - 1}" if len(others) < MOST_OTHERS + 2 else f"more than {MOST_OTHERS}"
            more = f", and of {count} more" if len(others) > 1 else ""
            message = f"{quoted(name)} starts inside of {quoted(others[0])}, whose center is at ({x:.1f}, {y:.1f}) m"
            yield start_diagnostic(scenario, name, message + more, "move one of them")
            yielded += 1
            if yielded == MAX_DIAGNOSTICS:
                yield start_diagnostic(scenario, name, "further actors that start inside of others are not listed", "")
                return


def _core(box: Sequence[float]) -> list[float]:
    """Return a box without its lowest part, and without the margin in which bodies touch."""
    x, y, z, length, width, height, yaw = box
    return [x, y, z + _LOW / 2.0, length - _TOUCH, width - _TOUCH, max(height - _LOW, 0.0), yaw]


def _trains(scenario: Scenario) -> Mapping[str, str]:
    """Return the foremost vehicle of each trailer."""
    front = {
        trailer: name for name, entity in scenario.entities.items() if (trailer := declared_trailer(entity)) is not None
    }
    found = {}
    for trailer, towing in front.items():
        seen = {trailer}
        while towing in front and towing not in seen:
            seen.add(towing)
            towing = front[towing]
        found[trailer] = towing
    return found


def _off_road(
    scenario: Scenario, roads: RoadNetwork | None, view: WorldView, names: Sequence[str]
) -> Iterator[Diagnostic]:
    """Yield the actors that start farther than `MARGIN` from every lane."""
    if roads is None or not names:
        return
    x, y = np.array([view.plain_boxes[view.rows[name]][:2] for name in names]).T
    outside = roads.locate(x, y, reach=np.inf).outside.tolist()
    for name, gap, place in zip(names, outside, zip(x.tolist(), y.tolist(), strict=True), strict=True):
        if gap > MARGIN:
            message = f"{quoted(name)} starts at ({place[0]:.1f}, {place[1]:.1f}) m, {gap:.0f} m off the nearest road"
            yield start_diagnostic(scenario, name, message, "give a LanePosition, or a world position on a lane")


def start_diagnostic(scenario: Scenario, name: str, message: str, hint: str) -> Diagnostic:
    """Return a diagnostic at the last TeleportAction of an actor in Init, or at the actor without one."""
    element: Element = scenario.entities[name]
    selections = EntitySelections(scenario)
    for private in scenario.storyboard.init.actions.private:
        if name in selections.members(private.entity_ref):
            for action in private.private_action:
                if action.teleport_action is not None:
                    element = action.teleport_action
    return Diagnostic(message, hint, element.source, element.line)
