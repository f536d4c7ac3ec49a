"""What stands in the boxes of a storyboard's picture: names, triggers and actions in words, and who waits for whom."""

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
    """What a line of a box says."""

    START = "start"
    STOP = "stop"
    WHO = "who"
    WHAT = "what"


@dataclass(frozen=True)
class BoxLine:
    """One line: a word in front (when, and, or, stop when, …) and its text."""

    role: Role
    lead: str
    text: str


@dataclass
class Box:
    """One element: its kind and name, a remark beside it, its lines, what it holds, and the elements it waits for."""

    kind: str
    title: str
    path: Path
    remark: str = ""
    lines: tuple[BoxLine, ...] = ()
    children: list[Box] = field(default_factory=list)
    waits_for: tuple[Path, ...] = ()

    def walk(self) -> Iterator[Box]:
        """This box and all that it holds."""
        yield self
        for child in self.children:
            yield from child.walk()


def story_boxes(storyboard: Storyboard) -> list[Box]:
    """The stories of a storyboard with all that they hold. A group with a single maneuver takes that into its box."""
    elements = ReferenceMatch((element.record.path, element) for element in _walk(storyboard.root))
    return [_box(story, elements) for story in storyboard.root.elements]


def init_boxes(storyboard: Storyboard) -> list[Box]:
    """What Init does: a box for each entity, one for what concerns all."""
    lines: dict[str, list[BoxLine]] = {}
    for behavior in storyboard.init.actions:
        lines.setdefault(behavior.actor_name or "global actions", []).append(
            BoxLine(Role.WHAT, "", behavior.describe())
        )
    return [Box("init", name, (name,), lines=tuple(dict.fromkeys(found))) for name, found in lines.items()]


def stop_lines(storyboard: Storyboard) -> tuple[BoxLine, ...]:
    """When the run ends, as far as the storyboard says."""
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
            lines.append(BoxLine(Role.WHAT, "maneuver", children[0].name))
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
        for place, monitor in enumerate(group.monitors):
            first = lead if number == 0 else f"or {lead.removeprefix('stops ')}"
            yield BoxLine(role, first if place == 0 else "and", monitor.describe())


def _waits(trigger: Trigger, elements: ReferenceMatch[StoryElement]) -> Iterator[Path]:
    """The elements whose state a trigger asks for; an action counts as the event that it belongs to."""
    for group in trigger.groups:
        for monitor in group.monitors:
            asked = monitor.condition.element
            if not isinstance(asked, StoryboardElementStateCondition):
                continue
            for element in elements.by(asked.storyboard_element_ref):
                if element.kind == asked.storyboard_element_type.value:
                    path = element.record.path
                    yield path[:-1] if isinstance(element, ActionElement) else path


def _group_lines(group: ManeuverGroupElement) -> list[BoxLine]:
    actions = [one for one in _walk(group) if isinstance(one, ActionElement)]
    actors = dict.fromkeys(name for one in actions for name in one.actors if name is not None)
    if any(one.triggering is not None for one in actions):
        actors["whoever fulfils the act's trigger"] = None
    return [BoxLine(Role.WHO, "", ", ".join(actors))] if actors else []


def _action_lines(action: ActionElement) -> list[BoxLine]:
    made = [behavior for actor in action.actors for behavior in action.behaviours(actor)]
    return [BoxLine(Role.WHAT, "", words) for words in dict.fromkeys(behavior.describe() for behavior in made)]


def has_maneuvers(boxes: list[Box]) -> bool:
    """Whether any maneuver has a box of its own."""
    return any(box.kind == ManeuverElement.kind for story in boxes for box in story.walk())
