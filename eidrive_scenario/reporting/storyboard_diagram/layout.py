"""Layout of a storyboard diagram: one column per level, parents at the height of their first child."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

from eidrive_scenario.openscenario.model import StoryboardElementStateCondition
from eidrive_scenario.openscenario.validation.names import ReferenceMatch
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.storyboard.tree.elements import ManeuverElement, ManeuverGroupElement, StoryElement
from eidrive_scenario.storyboard.tree.events import ActionElement, EventElement
from eidrive_scenario.storyboard.tree.trigger import Trigger

_NARROW = frozenset("iljtfrI.,:;'|!()[]/ ")
_WIDE = frozenset("mwMW@%≥≤±→")
_BOLD = 1.2
"""Width of bold text relative to regular text, sufficient for DejaVu Sans Bold."""


def width_of(text: str, size: float, *, bold: bool = False) -> float:
    """Return the width of a text [px] at a font size [px]."""
    return size * (_BOLD if bold else 1.0) * sum(_share(letter) for letter in text)


def _share(letter: str) -> float:
    """Return the width of a letter relative to the font size, between Helvetica and the wider DejaVu Sans."""
    if letter in _NARROW:
        return 0.35
    if letter in _WIDE:
        return 0.92
    return 0.7 if letter.isupper() else 0.59


def wrap_text(text: str, width: float, size: float) -> list[str]:
    """Wrap a text to lines of at most `width` [px]. A longer word is split, if possible at a part of the word."""
    lines: list[str] = []
    line = ""
    for word in text.split():
        longer = f"{line} {word}" if line else word
        if width_of(longer, size) <= width:
            line = longer
            continue
        lines.append(line)
        rest = word
        while (most := _fitting(rest, width, size)) < len(rest):
            part = _part(rest, most)
            lines.append(part)
            rest = rest[len(part) :]
        line = rest
    return [entry for entry in (*lines, line) if entry]


def _fitting(word: str, width: float, size: float) -> int:
    """Return the number of leading letters that fit, at least 1, in a time independent of the rest of the word."""
    total = 0.0
    for count, letter in enumerate(word):
        total += _share(letter)
        if size * total > width:
            return max(count, 1)
    return len(word)


def _part(word: str, limit: int) -> str:
    """Return at most `limit` leading letters of a word, up to a capital letter or after a separator if possible."""
    splits = (
        n
        for n in range(limit, limit // 2, -1)
        if word[n - 1] in "_-/." or (word[n].isupper() and not word[n - 1].isupper())
    )
    return word[: next(splits, limit)]


Path = tuple[str, ...]


class Role(StrEnum):
    """Meaning of a line of a box."""

    START = "start"
    STOP = "stop"
    ACTORS = "actors"
    CONTENT = "content"


@dataclass(frozen=True)
class BoxLine:
    """Line of a box: a leading word (when, and, or, stops when, …), the text, and its indent [px] once wrapped."""

    role: Role
    lead: str
    text: str
    indent: float = 0.0


TITLE, TEXT, LEADING = 13.0, 11.5, 16.0
"""Font sizes and line height [px]."""
PADDING, GAP, GUTTER, LANE = 10.0, 12.0, 40.0, 9.0
"""Distances inside a box, between boxes, between columns, and between parallel arrows [px]."""
COLUMNS = {"story": 165.0, "act": 230.0, "maneuverGroup": 190.0, "maneuver": 150.0, "event": 340.0, "action": 330.0}
"""Widths of the boxes of each column [px]."""
INIT_WIDTH = 300.0


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
    x: float = 0.0
    y: float = 0.0
    """Upper left corner [px], which `layout_diagram` sets."""

    def walk(self) -> Iterator[Box]:
        """Yield this box and all its descendants."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def width(self) -> float:
        """Width of the box [px], which depends on its kind."""
        return COLUMNS.get(self.kind, INIT_WIDTH)

    @cached_property
    def title_lines(self) -> list[str]:
        """The title, wrapped to the width beside the remark."""
        remark = width_of(self.remark, TEXT) + 8.0 if self.remark else 0.0
        return wrap_text(self.title, self.width - 2 * PADDING - remark, TITLE) or [""]

    @cached_property
    def text_lines(self) -> list[BoxLine]:
        """The lines, wrapped to the width."""
        return wrapped_lines(self.lines, self.width - 2 * PADDING)

    @property
    def height(self) -> float:
        """Height of the box [px]."""
        between = 4.0 if self.text_lines else 0.0
        return 2 * PADDING + LEADING * (len(self.title_lines) + len(self.text_lines)) + between - 3.0

    @property
    def middle(self) -> float:
        """Vertical position of connecting lines, at the title of the box [px]."""
        return self.y + PADDING + LEADING / 2


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
    return [Box("init", name, (name,), lines=tuple(dict.fromkeys(content))) for name, content in lines.items()]


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
        actions = [action for action in _walk(element) if isinstance(action, ActionElement)]
        actors = dict.fromkeys(name for action in actions for name in action.actors if name is not None)
        if any(action.triggering is not None for action in actions):
            actors["triggering entities of the act"] = None
        if actors:
            lines.append(BoxLine(Role.ACTORS, "", ", ".join(actors)))
        if len(children) == 1:
            lines.append(BoxLine(Role.CONTENT, "maneuver", children[0].name))
            children = children[0].elements
    if isinstance(element, ActionElement):
        behaviors = [behavior for actor in element.actors for behavior in element.behaviours(actor)]
        texts = dict.fromkeys(behavior.describe() for behavior in behaviors)
        lines += [BoxLine(Role.CONTENT, "", text) for text in texts]
    return Box(
        element.kind,
        element.name,
        element.record.path,
        remark_of(element),
        tuple(lines),
        [_box(child, elements) for child in children],
        tuple(dict.fromkeys(waits)),
    )


def remark_of(element: StoryElement) -> str:
    """Return the priority and the maximum number of executions of an element, as far as it has them."""
    remarks = [element.priority] if isinstance(element, EventElement) else []
    if isinstance(element, EventElement | ManeuverGroupElement) and element.limit != 1:
        remarks.append(f"up to {element.limit} times")
    return ", ".join(remarks)


def _trigger(trigger: Trigger, role: Role, lead: str) -> Iterator[BoxLine]:
    for number, group in enumerate(trigger.groups):
        for index, evaluator in enumerate(group.evaluators):
            first = lead if number == 0 else f"or {lead.removeprefix('stops ')}"
            yield BoxLine(role, first if index == 0 else "and", evaluator.describe())


def _waits(trigger: Trigger, elements: ReferenceMatch[StoryElement]) -> Iterator[Path]:
    """Yield the paths of elements whose state a trigger evaluates, with the event instead of an action."""
    for group in trigger.groups:
        for evaluator in group.evaluators:
            condition = evaluator.condition.element
            if not isinstance(condition, StoryboardElementStateCondition):
                continue
            for element in elements.by(condition.storyboard_element_ref):
                if element.kind == condition.storyboard_element_type.value:
                    path = element.record.path
                    yield path[:-1] if isinstance(element, ActionElement) else path


@dataclass(frozen=True)
class Arrow:
    """Arrow from an element to a dependent element of its level, in a lane left of the column [px]."""

    source: Box
    target: Box
    lane: float


@dataclass(frozen=True)
class DiagramLayout:
    """All boxes and arrows, and the size of the diagram [px]."""

    stories: Sequence[Box]
    arrows: list[Arrow]
    columns: dict[str, float]
    width: float
    height: float


def columns_of(stories: Sequence[Box], x: float) -> tuple[dict[str, float], float]:
    """Return the left ends of the columns with boxes from `x` on, and the right end of the last one [px].

    Beside each column is a lane for each of its arrows, up to 8.
    """
    lanes = Counter(target.kind for _, target in _dependencies(stories))
    has_maneuvers = any(box.kind == ManeuverElement.kind for story in stories for box in story.walk())
    columns: dict[str, float] = {}
    for kind, width in COLUMNS.items():
        if kind != ManeuverElement.kind or has_maneuvers:
            columns[kind] = x + min(lanes[kind], 8) * LANE
            x = columns[kind] + width + GUTTER
    return columns, x - GUTTER


def layout_diagram(stories: Sequence[Box], x: float, y: float) -> DiagramLayout:
    """Arrange the stories vertically, with the given upper left corner [px]."""
    columns, right = columns_of(stories, x)
    for story in stories:
        y = _place(story, columns, y) + GAP
    return DiagramLayout(stories, _arrows(stories, columns), columns, right, y)


def wrapped_lines(lines: Sequence[BoxLine], width: float) -> list[BoxLine]:
    """Return the lines of a box, wrapped to a width [px]. Leading words are bold, and on the first of several lines."""
    wrapped = []
    for line in lines:
        indent = width_of(line.lead + " ", TEXT, bold=True) if line.lead else 0.0
        for number, part in enumerate(wrap_text(line.text, width - indent, TEXT) or [""]):
            wrapped.append(BoxLine(line.role, line.lead if number == 0 else "", part, indent))
    return wrapped


def _place(box: Box, columns: Mapping[str, float], y: float) -> float:
    """Place a box and its descendants, and return the lower end of its area [px]."""
    box.x, box.y = columns[box.kind], y
    below = y
    for child in box.children:
        below = _place(child, columns, below) + GAP
    return max(y + box.height, below - GAP)


def _dependencies(stories: Sequence[Box]) -> list[tuple[Box, Box]]:
    """Return each box that another box of its level waits for, with the other one."""
    boxes = {box.path: box for story in stories for box in story.walk()}
    return [
        (source, target)
        for target in boxes.values()
        for path in target.waits_for
        if (source := boxes.get(path)) is not None and source is not target and source.kind == target.kind
    ]


def _arrows(stories: Sequence[Box], columns: Mapping[str, float]) -> list[Arrow]:
    """Assign each arrow to the first free lane. Short arrows come first, so they are next to the boxes."""
    occupied: dict[str, list[list[tuple[float, float]]]] = {}
    arrows = []
    for source, target in sorted(_dependencies(stories), key=lambda pair: abs(pair[0].y - pair[1].y)):
        low, high = sorted((source.y, target.y))
        lanes = occupied.setdefault(target.kind, [])
        free = (n for n, spans in enumerate(lanes) if all(high < a or low > b for a, b in spans))
        number = next(free, len(lanes))
        if number == len(lanes):
            lanes.append([])
        lanes[number].append((low, high))
        arrows.append(Arrow(source, target, columns[target.kind] - 10.0 - LANE * (number % 9)))
    return arrows
