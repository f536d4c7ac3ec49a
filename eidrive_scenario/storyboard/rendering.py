"""A storyboard as text: its elements, their triggers and actions in words."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.storyboard.elements import ManeuverGroupElement, StoryElement
from eidrive_scenario.storyboard.events import ActionElement, EventElement
from eidrive_scenario.storyboard.storyboard import Storyboard

Branch = tuple[str, list["Branch"]]
KINDS = {"maneuverGroup": "group"}


def render(storyboard: Storyboard) -> str:
    """The tree of a storyboard, one line per element, trigger and action."""
    init: Branch = ("Init", [(_line(b.actor_name, b.describe()), []) for b in storyboard.init.actions])
    root = storyboard.root
    below = [init, *(_branch(element) for element in root.elements)]
    if root.stop_leaf is not None:
        below.append((f"stop when {root.stop_leaf.trigger.describe()}", []))
    return "\n".join(["storyboard", *_lines(below, "")])


def _branch(element: StoryElement) -> Branch:
    below: list[Branch] = []
    if element.start_leaf is not None:
        below.append((f"when {element.start_leaf.trigger.describe()}", []))
    if isinstance(element, ActionElement):
        return _action(element)
    below += [_branch(child) for child in element.elements]
    if element.stop_leaf is not None:
        below.append((f"stop when {element.stop_leaf.trigger.describe()}", []))
    return f"{KINDS.get(element.kind, element.kind)} {element.name}{_notes(element)}", below


def _action(element: ActionElement) -> Branch:
    made = [behaviour for actor in element.actors for behaviour in element.behaviours(actor)]
    words = list(dict.fromkeys(behaviour.describe() for behaviour in made))
    actors = ", ".join(dict.fromkeys(behaviour.actor_name for behaviour in made if behaviour.actor_name))
    if element.by_trigger:
        actors = ", ".join(filter(None, (actors, "whoever fulfils the trigger")))
    return f"action {element.name}: {_line(actors, '; '.join(words))}", []


def _line(actor: str | None, words: str) -> str:
    return f"{actor}: {words}" if actor else words


def _notes(element: StoryElement) -> str:
    notes = []
    if isinstance(element, EventElement):
        notes.append(element.priority)
    if isinstance(element, EventElement | ManeuverGroupElement) and element.limit != 1:
        notes.append(f"up to {element.limit} times")
    return f" ({', '.join(notes)})" if notes else ""


def _lines(branches: list[Branch], indent: str) -> Iterator[str]:
    for number, (text, below) in enumerate(branches):
        last = number == len(branches) - 1
        yield f"{indent}{'└─ ' if last else '├─ '}{text}"
        yield from _lines(below, indent + ("   " if last else "│  "))
