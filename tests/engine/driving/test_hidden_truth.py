"""Decisions of the ego do not depend on actors that no sensor and no message has shown.

Each hidden actor of each library scenario is moved; the plans are the same up to the first detection.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from lxml import etree

from eidrive_scenario.api.run import RunSettings, Simulation
from eidrive_scenario.extensions.library import describe_scenarios, library_path
from eidrive_scenario.recording.frame import Frame

EGO = "Ego"
STATION = 'name="module" value="eidrive"'
WITHOUT_DRIVER = ("coop/scenario_3", "coop/scenario_4")
CASES = [
    (entry.name, channel)
    for entry in describe_scenarios()
    if entry.name not in WITHOUT_DRIVER
    for channel in ("none", "ideal")[: (library_path() / f"{entry.name}.xosc").read_text().count(STATION)]
]
"""Scenarios and channels; with a single station the channel has no effect."""
CAUTIOUS = ("ncap/crossing_car", "coop/scenario_1", "coop/scenario_2")
"""Scenarios that are also run with caution before hidden lanes."""
PARAMETERS = {"corner_cases/wrong_clock": {"ClockOffset": "0"}}
"""Parameters by scenario: a wrong clock moves reported actors by more than `NEAR`, so that they count as unknown."""
START = 20
"""Number of ticks after which actors count as hidden; the first messages arrive before."""
LONGEST = 8.0
"""Maximum simulated time [s]."""
SHIFT = 0.6
"""Distance by which a hidden actor is moved [m]."""
NEAR = 3.0
"""Distance from a known object within which an actor is taken to be known [m]."""


class Decision(NamedTuple):
    """Plan of one tick, the actors that the ego has known up to it, and the positions of all other actors."""

    reason: str
    points: bytes
    speeds: bytes
    known: frozenset[str]
    places: Mapping[str, bytes]


def decisions(path: Path, channel: str, **given: str) -> Iterator[Decision]:
    parameters = {**PARAMETERS.get(f"{path.parent.name}/{path.stem}", {}), **given}
    settings = RunSettings(channel=channel, planner="behavior", parameters=parameters)
    with Simulation(path, seed=1, settings=settings) as simulation:
        known: frozenset[str] = frozenset()
        end = None
        while end is None:
            frame, end = simulation.tick()
            step = frame.steps.get(EGO)
            if step is None or step.plan is None or frame.view.time > LONGEST:
                return
            known |= _known(frame)
            places = {
                other: frame.view.position[row].tobytes() for other, row in frame.view.rows.items() if other != EGO
            }
            yield Decision(step.plan.reason, step.plan.points.tobytes(), step.plan.speeds.tobytes(), known, places)


def _known(frame: Frame) -> frozenset[str]:
    step, view = frame.steps[EGO], frame.view
    found = set()
    for objects in (step.detections, step.fused):
        if len(objects.boxes):
            away = np.hypot(
                view.boxes[:, None, 0] - objects.boxes[None, :, 0], view.boxes[:, None, 1] - objects.boxes[None, :, 1]
            )
            found |= {view.names[row] for row in np.flatnonzero((away < NEAR).any(axis=1)).tolist()}
    return frozenset(found)


def _others_react(before: Decision, after: Decision, actor: str) -> bool:
    """Return whether the storyboard moves other actors differently, which the ego may observe."""
    names = (before.places.keys() | after.places.keys()) - {actor}
    return any(before.places.get(name) != after.places.get(name) for name in names)


def moved(path: Path, actor: str, folder: Path) -> Path | None:
    """Write the scenario with one actor moved; return None if its position has no coordinates."""
    tree: Any = etree.parse(path)
    places = tree.xpath(
        f"//Init//Private[@entityRef='{actor}']//TeleportAction/Position/*[self::LanePosition or self::WorldPosition]"
    )
    if not places:
        return None
    place = places[0]
    key = "s" if place.tag == "LanePosition" else "x"
    text = place.get(key, "0")
    expression = text[2:-1] if text.startswith("${") else text
    place.set(key, f"${{({expression}) + {SHIFT}}}")
    target = folder / path.parent.name / path.name
    target.parent.mkdir(parents=True, exist_ok=True)
    for entry in library_path().iterdir():
        if entry.name != path.parent.name and not (folder / entry.name).exists():
            (folder / entry.name).symlink_to(entry.resolve())
    tree.write(target, encoding="UTF-8", xml_declaration=True)
    return target


@pytest.mark.exhaustive
@pytest.mark.parametrize(("name", "channel"), CASES)
def test_hidden_actor_has_no_influence_before_its_detection(name: str, channel: str, tmp_path: Path) -> None:
    check_hidden_actors(name, channel, tmp_path)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", CAUTIOUS)
def test_hidden_actor_has_no_influence_on_caution(name: str, tmp_path: Path) -> None:
    check_hidden_actors(name, "none", tmp_path, Caution="true")


def check_hidden_actors(name: str, channel: str, tmp_path: Path, **parameters: str) -> None:
    """Move each hidden actor and compare the decisions up to its first detection."""
    path = library_path() / f"{name}.xosc"
    tree: Any = etree.parse(path)
    actors = [element.get("name") for element in tree.iterfind(".//Entities/ScenarioObject")]
    unchanged = decisions(path, channel, **parameters)
    original = list(islice(unchanged, START + 1))
    hidden = [actor for actor in actors if len(original) > START and actor not in original[START].known]
    hidden = [actor for actor in hidden if actor != EGO]
    for actor in hidden:
        other = moved(path, actor, tmp_path / actor)
        if other is None:
            continue
        for step, after in enumerate(decisions(other, channel, **parameters)):
            original += islice(unchanged, max(0, step + 1 - len(original)))
            if step == len(original):
                break
            before = original[step]
            if actor in before.known or actor in after.known or _others_react(before, after, actor):
                break
            assert before[:3] == after[:3], f"{actor} at step {step}"


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "actor"),
    [
        ("ei/scenario_03", "Crossing"),
        ("driving/crossing_car_occluded_left", "Crossing"),
        ("coop/scenario_1", "Incoming"),
    ],
)
def test_library_has_hidden_actors(name: str, actor: str) -> None:
    """The comparison is not empty: these actors are unknown for more than a second."""
    steps = decisions(library_path() / f"{name}.xosc", "none")
    assert actor not in next(islice(steps, 20, None)).known
