"""Reasons of decisions as texts, with the objects that they name."""

from __future__ import annotations

from eidrive_scenario.driving.planning.behavior.bounds import FREE, LIMIT, WALL
from eidrive_scenario.driving.planning.behavior.lateral import ROUTE
from eidrive_scenario.driving.planning.behavior.options import Options
from eidrive_scenario.driving.planning.behavior.situation import Situation


def reason_of(situation: Situation, options: Options, best: int) -> tuple[str, tuple[int, ...]]:
    """Return the reason of a proposal, and the rows of its objects."""
    proposal = options.proposals[best]
    profile = options.profiles[proposal.profile]
    owners = situation.prediction.objects
    if proposal.is_emergency:
        threat = _threat(options, best)
        if threat is None:
            return "emergency braking", ()
        owner = owners[threat]
        return f"emergency braking: collision course with {situation.kind_of(owner)}", situation.rows_of(owner)
    maneuver = "" if profile.name == ROUTE else f"{profile.name}; "
    causes = options.rolled.cause[best].tolist()
    for cause in causes:
        if cause >= 0:
            verb = "stop for" if situation.approaches(owners[cause]) else "follow"
            return f"{maneuver}{verb} {situation.describe(owners[cause])}", situation.rows_of(owners[cause])
        if cause <= WALL:
            wall = options.walls[best][WALL - cause]
            held = None if wall.owner is None else owners[wall.owner]
            return f"{maneuver}{wall.reason}", situation.rows_of(held)
    if proposal.share < 1.0 and owners:
        return f"{maneuver}slow down for traffic ahead", ()
    if proposal.share < 1.0:
        walls = options.walls[best]
        return f"{maneuver}{walls[0].reason if walls else 'curve or end of route ahead'}", ()
    if LIMIT in causes and causes[0] != FREE:
        hidden = situation.hidden_at(float(options.rolled.s[best, causes.index(LIMIT) + 1]))
        if hidden:
            return f"{maneuver}caution before a hidden {hidden}", ()
        return f"{maneuver}curve or end of route ahead", ()
    return f"{maneuver}keep speed", ()


def _threat(options: Options, emergency: int) -> int | None:
    """Return the hypothesis for which the vehicle brakes in an emergency: that with which the first other proposal
    collides, else the one for which it brakes."""
    other = next((row for row, proposal in enumerate(options.proposals) if not proposal.is_emergency), emergency)
    threat = int(options.evaluation.cause[other])
    if threat >= 0:
        return threat
    for cause in options.rolled.cause[other].tolist():
        if cause >= 0:
            return int(cause)
        if cause <= WALL:
            wall = options.walls[other][WALL - int(cause)]
            return wall.owner
    return None
