"""Where the boxes of a storyboard's picture stand: a column for each level, parents beside their first child."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from eidrive_scenario.reporting.storyboard_diagram.boxes import Box, BoxLine, Path, has_maneuvers
from eidrive_scenario.reporting.storyboard_diagram.text_width import broken, width_of

TITLE, TEXT, LEADING = 13.0, 11.5, 16.0
"""Font sizes and line height [px]."""
PADDING, GAP, GUTTER, LANE = 10.0, 12.0, 40.0, 9.0
"""Inside a box, between boxes, between columns, between arrows that run side by side [px]."""
WIDTHS = {"story": 165.0, "act": 230.0, "maneuverGroup": 190.0, "maneuver": 150.0, "event": 340.0, "action": 330.0}
INIT_WIDTH = 300.0


@dataclass(frozen=True)
class TextLine:
    """A line as it is drawn: the word in front (on the first line of several), the text and where it begins [px]."""

    source: BoxLine
    lead: str
    text: str
    indent: float


@dataclass
class Placed:
    """A box with its place [px] and the lines that it shows."""

    box: Box
    x: float
    y: float
    width: float
    title: list[str]
    lines: list[TextLine]
    children: list[Placed] = field(default_factory=list)

    @property
    def height(self) -> float:
        """Of the box [px]."""
        between = 4.0 if self.lines else 0.0
        return 2 * PADDING + LEADING * (len(self.title) + len(self.lines)) + between - 3.0

    @property
    def middle(self) -> float:
        """Height at which lines meet the box: that of its title [px]."""
        return self.y + PADDING + LEADING / 2

    def walk(self) -> Iterator[Placed]:
        """This box and all that it holds."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True)
class Arrow:
    """From an element to one of its own level that waits for it; it runs in a lane left of the column [px]."""

    source: Placed
    target: Placed
    lane: float


@dataclass(frozen=True)
class DiagramLayout:
    """All boxes and arrows, and the size of the whole [px]."""

    stories: list[Placed]
    arrows: list[Arrow]
    columns: dict[str, float]
    width: float
    height: float


def layout_diagram(stories: Sequence[Box], x: float, y: float) -> DiagramLayout:
    """Place stories below each other, from a corner on."""
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
    """The lines of a box, broken to a width [px]."""
    shown = []
    for line in lines:
        indent = width_of(line.lead + " ", TEXT) if line.lead else 0.0
        for number, part in enumerate(broken(line.text, width - indent, TEXT) or [""]):
            shown.append(TextLine(line, line.lead if number == 0 else "", part, indent))
    return shown


def sized(box: Box, x: float, y: float, width: float) -> Placed:
    """A box at a place, its text broken to its width."""
    inside = width - 2 * PADDING
    remark = width_of(box.remark, TEXT) + 8.0 if box.remark else 0.0
    title = broken(box.title, inside - remark, TITLE) or [""]
    return Placed(box, x, y, width, title, text_lines(box.lines, inside))


def _place(box: Box, columns: dict[str, float], y: float) -> tuple[Placed, float]:
    """The box at this height, and where what comes below it may begin."""
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
    """How many lanes the arrows of each column may need: no more than there are arrows, and not too many."""
    kinds = {box.path: box.kind for story in stories for box in story.walk()}
    count: dict[str, int] = {}
    for story in stories:
        for box in story.walk():
            own = sum(kinds.get(path) == box.kind and path != box.path for path in box.waits_for)
            count[box.kind] = count.get(box.kind, 0) + own
    return {kind: min(number, 8) for kind, number in count.items()}


def _arrows(boxes: dict[Path, Placed], columns: dict[str, float]) -> list[Arrow]:
    """Each arrow takes the first lane that is free along its way; short ones come first, so they run near the boxes."""
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
