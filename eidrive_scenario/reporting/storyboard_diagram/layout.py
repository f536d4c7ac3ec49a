"""Layout of a storyboard diagram: one column per level, parents at the height of their first child."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from eidrive_scenario.reporting.storyboard_diagram.boxes import Box, BoxLine, Path, has_maneuvers
from eidrive_scenario.reporting.storyboard_diagram.text_width import width_of, wrap_text

TITLE, TEXT, LEADING = 13.0, 11.5, 16.0
"""Font sizes and line height [px]."""
PADDING, GAP, GUTTER, LANE = 10.0, 12.0, 40.0, 9.0
"""Distances inside a box, between boxes, between columns, and between parallel arrows [px]."""
WIDTHS = {"story": 165.0, "act": 230.0, "maneuverGroup": 190.0, "maneuver": 150.0, "event": 340.0, "action": 330.0}
INIT_WIDTH = 300.0


@dataclass(frozen=True)
class TextLine:
    """Drawn line: the leading word on the first of several lines, the text, and its indent [px]."""

    source: BoxLine
    lead: str
    text: str
    indent: float


@dataclass
class Placed:
    """Box with its position [px] and its drawn lines."""

    box: Box
    x: float
    y: float
    width: float
    title: list[str]
    lines: list[TextLine]
    children: list[Placed] = field(default_factory=list)

    @property
    def height(self) -> float:
        """Height of the box [px]."""
        between = 4.0 if self.lines else 0.0
        return 2 * PADDING + LEADING * (len(self.title) + len(self.lines)) + between - 3.0

    @property
    def middle(self) -> float:
        """Vertical position of connecting lines, at the title of the box [px]."""
        return self.y + PADDING + LEADING / 2

    def walk(self) -> Iterator[Placed]:
        """Yield this box and all its descendants."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True)
class Arrow:
    """Arrow from an element to a dependent element of its level, in a lane left of the column [px]."""

    source: Placed
    target: Placed
    lane: float


@dataclass(frozen=True)
class DiagramLayout:
    """All boxes and arrows, and the size of the diagram [px]."""

    stories: list[Placed]
    arrows: list[Arrow]
    columns: dict[str, float]
    width: float
    height: float


def layout_diagram(stories: Sequence[Box], x: float, y: float) -> DiagramLayout:
    """Arrange the stories vertically, with the given upper left corner [px]."""
    lanes = _lanes(stories)
    columns: dict[str, float] = {}
    right = x
    for kind, width in WIDTHS.items():
        if kind == "maneuver" and not has_maneuvers(list(stories)):
            continue
        right += lanes.get(kind, 0) * LANE
        columns[kind] = right
        right += width + GUTTER
    placed = []
    bottom = y
    for story in stories:
        tree, bottom = _place(story, columns, bottom)
        placed.append(tree)
        bottom += GAP
    boxes = {one.box.path: one for tree in placed for one in tree.walk()}
    return DiagramLayout(placed, _arrows(boxes, columns), columns, right - GUTTER, bottom)


def text_lines(lines: Sequence[BoxLine], width: float) -> list[TextLine]:
    """Return the lines of a box, wrapped to a width [px]. Leading words are bold."""
    shown = []
    for line in lines:
        indent = width_of(line.lead + " ", TEXT, bold=True) if line.lead else 0.0
        for number, part in enumerate(wrap_text(line.text, width - indent, TEXT) or [""]):
            shown.append(TextLine(line, line.lead if number == 0 else "", part, indent))
    return shown


def sized(box: Box, x: float, y: float, width: float) -> Placed:
    """Return a box at a position, with its text wrapped to its width."""
    inside = width - 2 * PADDING
    remark = width_of(box.remark, TEXT) + 8.0 if box.remark else 0.0
    title = wrap_text(box.title, inside - remark, TITLE) or [""]
    return Placed(box, x, y, width, title, text_lines(box.lines, inside))


def _place(box: Box, columns: dict[str, float], y: float) -> tuple[Placed, float]:
    """Place a box and its descendants, and return it with the lower end of its area [px]."""
    placed = sized(box, columns[box.kind], y, WIDTHS[box.kind])
    below = y
    for child in box.children:
        tree, below = _place(child, columns, below)
        placed.children.append(tree)
        below += GAP
    bottom = max(placed.y + placed.height, below - GAP if box.children else y)
    return placed, bottom


def _pairs(boxes: dict[Path, Placed]) -> Iterator[tuple[Placed, Placed]]:
    for target in boxes.values():
        for path in target.box.waits_for:
            source = boxes.get(path)
            if source is not None and source is not target and source.box.kind == target.box.kind:
                yield source, target


def _lanes(stories: Sequence[Box]) -> dict[str, int]:
    """Return the number of lanes of each column: the number of its arrows, up to 8."""
    kinds = {box.path: box.kind for story in stories for box in story.walk()}
    count: dict[str, int] = {}
    for story in stories:
        for box in story.walk():
            own = sum(kinds.get(path) == box.kind and path != box.path for path in box.waits_for)
            count[box.kind] = count.get(box.kind, 0) + own
    return {kind: min(number, 8) for kind, number in count.items()}


def _arrows(boxes: dict[Path, Placed], columns: dict[str, float]) -> list[Arrow]:
    """Assign each arrow to the first free lane. Short arrows come first, so they are next to the boxes."""
    pairs = sorted(_pairs(boxes), key=lambda pair: abs(pair[0].y - pair[1].y))
    taken: dict[str, list[list[tuple[float, float]]]] = {}
    arrows = []
    for source, target in pairs:
        low, high = sorted((source.y, target.y))
        lanes = taken.setdefault(target.box.kind, [])
        free = (n for n, used in enumerate(lanes) if all(high < a or low > b for a, b in used))
        number = next(free, len(lanes))
        if number == len(lanes):
            lanes.append([])
        lanes[number].append((low, high))
        arrows.append(Arrow(source, target, columns[target.box.kind] - 10.0 - LANE * (number % 9)))
    return arrows
