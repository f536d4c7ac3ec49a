"""Content of the boxes of a storyboard diagram: names, triggers, actions, and dependencies between elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum

from eidrive_scenario.openscenario.model import StoryboardElementStateCondition
from eidrive_scenario.openscenario.validation.storyboard_names import ReferenceMatch
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.storyboard.tree.elements import ManeuverElement, ManeuverGroupElement, StoryElement
from eidrive_scenario.storyboard.tree.events import ActionElement, EventElement
from eidrive_scenario.storyboard.tree.trigger import Trigger

Path = tuple[str, ...]


class Role(StrEnum):
    """Meaning of a line of a box."""

    START = "start"
    STOP = "stop"
    ACTORS = "actors"
    CONTENT = "content"


@dataclass(frozen=True)
class BoxLine:
    """Line of a box: a leading word (when, and, or, stops when, …) and its text."""

    role: Role
    lead: str
    text: str


@dataclass
class Box:
    """Box of one element: kind, name, remark, lines, children, and paths of the elements that its trigger refers to."""

    kind: str
    title: str
    path: Path
    remark: str = ""
    lines: tuple[BoxLine, ...] = ()
    children: list[Box] = field(default_factory=list)
    waits_for: tuple[Path, ...] = ()

    def walk(self) -> Iterator[Box]:
        """Yield this box and all its descendants."""
        yield self
        for child in self.children:
            yield from child.walk()


def story_boxes(storyboard: Storyboard) -> list[Box]:
    """Return the boxes of all stories. The box of a group with a single maneuver includes the maneuver."""
    elements = ReferenceMatch((element.record.path, element) for element in _walk(storyboard.root))
    return [_box(story, elements) for story in storyboard.root.elements]


def init_boxes(storyboard: Storyboard) -> list[Box]:
    """Return the boxes of Init: one for each entity, and one for global actions."""
    lines: dict[str, list[BoxLine]] = {}
    for behavior in storyboard.init.actions:
        lines.setdefault(behavior.actor_name or "global actions", []).append(
            BoxLine(Role.CONTENT, "", behavior.describe())
        )
    return [Box("init", name, (name,), lines=tuple(dict.fromkeys(found))) for name, found in lines.items()]


def stop_lines(storyboard: Storyboard) -> tuple[BoxLine, ...]:
    """Return the conditions of the stop trigger of the storyboard."""
    leaf = storyboard.root.stop_leaf
    if leaf is None:
        return (BoxLine(Role.STOP, "when", "every story has ended"),)
    return tuple(_trigger(leaf.trigger, Role.STOP, "when"))


def _walk(element: StoryElement) -> Iterator[StoryElement]:
    yield element
    for child in element.elements:
        yield from _walk(child)


def _box(element: StoryElement, elements: ReferenceMatch[StoryElement]) -> Box:
    lines: list[BoxLine] = []
    waits: list[Path] = []
    if element.start_leaf is not None:
        lines += _trigger(element.start_leaf.trigger, Role.START, "when")
        waits += _waits(element.start_leaf.trigger, elements)
    if element.stop_leaf is not None:
        lines += _trigger(element.stop_leaf.trigger, Role.STOP, "stops when")
    children = element.elements
    if isinstance(element, ManeuverGroupElement):
        lines += _group_lines(element)
        if len(children) == 1:
            lines.append(BoxLine(Role.CONTENT, "maneuver", children[0].name))
            children = children[0].elements
    if isinstance(element, ActionElement):
        lines += _action_lines(element)
    return Box(
        element.kind,
        element.name,
        element.record.path,
        _remark(element),
        tuple(lines),
        [_box(child, elements) for child in children],
        tuple(dict.fromkeys(waits)),
    )


def _remark(element: StoryElement) -> str:
    remarks = [element.priority] if isinstance(element, EventElement) else []
    if isinstance(element, EventElement | ManeuverGroupElement) and element.limit != 1:
        remarks.append(f"up to {element.limit} times")
    return ", ".join(remarks)


def _trigger(trigger: Trigger, role: Role, lead: str) -> Iterator[BoxLine]:
    for number, group in enumerate(trigger.groups):
        for index, monitor in enumerate(group.monitors):
            first = lead if number == 0 else f"or {lead.removeprefix('stops ')}"
            yield BoxLine(role, first if index == 0 else "and", monitor.describe())


def _waits(trigger: Trigger, elements: ReferenceMatch[StoryElement]) -> Iterator[Path]:
    """Yield the paths of elements whose state a trigger evaluates, with the event instead of an action."""
    for group in trigger.groups:
        for monitor in group.monitors:
            condition = monitor.condition.element
            if not isinstance(condition, StoryboardElementStateCondition):
                continue
            for element in elements.by(condition.storyboard_element_ref):
                if element.kind == condition.storyboard_element_type.value:
                    path = element.record.path
                    yield path[:-1] if isinstance(element, ActionElement) else path


def _group_lines(group: ManeuverGroupElement) -> list[BoxLine]:
    actions = [one for one in _walk(group) if isinstance(one, ActionElement)]
    actors = dict.fromkeys(name for one in actions for name in one.actors if name is not None)
    if any(one.triggering is not None for one in actions):
        actors["triggering entities of the act"] = None
    return [BoxLine(Role.ACTORS, "", ", ".join(actors))] if actors else []


def _action_lines(action: ActionElement) -> list[BoxLine]:
    behaviors = [behavior for actor in action.actors for behavior in action.behaviours(actor)]
    return [BoxLine(Role.CONTENT, "", text) for text in dict.fromkeys(behavior.describe() for behavior in behaviors)]


def has_maneuvers(boxes: list[Box]) -> bool:
    """True if any maneuver has a separate box."""
    return any(box.kind == ManeuverElement.kind for story in boxes for box in story.walk())
