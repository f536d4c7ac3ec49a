"""Storyboard diagram as SVG: elements, actors, triggers, actions, and dependencies between elements."""

from __future__ import annotations

from html import escape
from pathlib import Path

from eidrive_scenario.errors import counted
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.reporting.storyboard_diagram.layout import (
    GAP,
    INIT_WIDTH,
    LEADING,
    PADDING,
    TEXT,
    TITLE,
    Arrow,
    Box,
    BoxLine,
    Role,
    columns_of,
    init_boxes,
    layout_diagram,
    stop_lines,
    story_boxes,
    wrapped_lines,
)
from eidrive_scenario.storyboard.storyboard import Storyboard

MARGIN = 28.0
INK, MUTED, WIRE = "#1e293b", "#64748b", "#cbd5e1"
ROLES = {Role.START: "#15803d", Role.STOP: "#b91c1c", Role.ACTORS: "#475569", Role.CONTENT: "#475569"}
KINDS = {
    "init": ("Init", "#94a3b8"),
    "story": ("Story", "#64748b"),
    "act": ("Act", "#0369a1"),
    "maneuverGroup": ("Maneuver group", "#0f766e"),
    "maneuver": ("Maneuver", "#4d7c0f"),
    "event": ("Event", "#b45309"),
    "action": ("Action", "#7c3aed"),
}
ARROWS = ("#b45309", "#0369a1", "#be185d", "#4d7c0f", "#7c3aed", "#0f766e")


def write_storyboard_diagram(storyboard: Storyboard, out: Path) -> Path:
    """Draw a storyboard to an SVG file and return `out`. Raise SettingError if the file cannot be written."""
    with write_atomically(out) as stream:
        stream.write(storyboard_diagram(storyboard).encode())
    return out


def storyboard_diagram(storyboard: Storyboard) -> str:
    """Return the SVG of a storyboard: Init at the top, one column per level, and arrows to dependent elements."""
    stories = story_boxes(storyboard)
    width = max(columns_of(stories, MARGIN)[1], MARGIN + 3 * INIT_WIDTH + 2 * GAP)
    head, y = _head(storyboard, width)
    init, y = _init(storyboard, y, width)
    layout = layout_diagram(stories, MARGIN, y + 52.0)
    boxes = [box for story in stories for box in story.walk()]
    parts = [*head, *init]
    for kind, x in layout.columns.items():
        parts.append(_text(x, y + 34.0, KINDS[kind][0], weight=700, color=KINDS[kind][1]))
    parts += [_wire(box, child) for box in boxes for child in box.children]
    parts += [_arrow(arrow, ARROWS[number % len(ARROWS)]) for number, arrow in enumerate(layout.arrows)]
    parts += [part for box in boxes for part in _box(box)]
    full, height = width + MARGIN, layout.height + MARGIN
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{full:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {full:.0f} {height:.0f}" font-family="Inter, Helvetica, Arial, sans-serif" '
        f'font-size="{TEXT}" fill="{INK}"><title>{escape(storyboard.scenario.name)}</title>{_DEFINITIONS}'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>\n'
    )


_DEFINITIONS = (
    "<style>.arrow:hover path{stroke-width:3}.arrow path{stroke-width:1.5}</style>"
    '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto" '
    'markerUnits="userSpaceOnUse"><path d="M0 0L8 4L0 8z" fill="context-stroke"/></marker></defs>'
)


def _head(storyboard: Storyboard, width: float) -> tuple[list[str], float]:
    scenario = storyboard.scenario
    version = ".".join(map(str, scenario.version))
    count = counted(len(scenario.entities), "entity", "entities")
    parts = [
        _text(MARGIN, MARGIN + 18, scenario.name, size=22, weight=700),
        _text(MARGIN, MARGIN + 37, f"OpenSCENARIO {version}, {count}", color=MUTED),
    ]
    y = MARGIN + 60
    first, *others = stop_lines(storyboard)
    shown = [BoxLine(first.role, f"The run stops {first.lead}", first.text), *others]
    for line in wrapped_lines(shown, width - MARGIN):
        parts.append(_line(MARGIN, y, line))
        y += LEADING
    return parts, y + 8


def _init(storyboard: Storyboard, y: float, width: float) -> tuple[list[str], float]:
    """Draw the boxes of Init in rows, and return them with the lower end of the last row [px]."""
    boxes = init_boxes(storyboard)
    if not boxes:
        return [], y
    parts = [_text(MARGIN, y + 12, "Init", weight=700, color=MUTED)]
    columns = max(1, int((width - MARGIN + GAP) // (INIT_WIDTH + GAP)))
    y += 22.0
    for first in range(0, len(boxes), columns):
        row = boxes[first : first + columns]
        for number, box in enumerate(row):
            box.x, box.y = MARGIN + number * (INIT_WIDTH + GAP), y
            parts += _box(box)
        y += max(box.height for box in row) + GAP
    return parts, y


def _box(box: Box) -> list[str]:
    (name, color), path = KINDS[box.kind], " / ".join(box.path)
    x, y, width, height = box.x, box.y, box.width, box.height
    parts = [
        f"<g><title>{escape(f'{name}: {path}')}</title>",
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="5" fill="{color}" '
        f'fill-opacity="0.07" stroke="{color}" stroke-opacity="0.45"/>',
        f'<path d="M{x + 1.5:.1f} {y + 4:.1f}v{height - 8:.1f}" stroke="{color}" stroke-width="3"/>',
    ]
    base = y + PADDING + TITLE - 2
    for number, title in enumerate(box.title_lines):
        parts.append(_text(x + PADDING, base + number * LEADING, title, size=TITLE, weight=700))
    if box.remark:
        parts.append(_text(x + width - PADDING, base, box.remark, color=color, anchor="end"))
    base += LEADING * len(box.title_lines) + 4
    for number, line in enumerate(box.text_lines):
        parts.append(_line(x + PADDING, base + number * LEADING, line))
    return [*parts, "</g>"]


def _line(x: float, y: float, line: BoxLine) -> str:
    text = _text(x + line.indent, y, line.text, weight=600 if line.role is Role.ACTORS else 400)
    return (_text(x, y, line.lead, color=ROLES[line.role], weight=600) if line.lead else "") + text


def _wire(parent: Box, child: Box) -> str:
    x0, x1 = parent.x + parent.width, child.x
    y0, y1 = parent.middle, child.middle
    bend = x0 + 12.0
    if abs(y1 - y0) < 0.5:
        curve = f"M{x0:.1f} {y0:.1f}H{x1:.1f}"
    else:
        curve = f"M{x0:.1f} {y0:.1f}H{bend - 5:.1f}q5 0 5 5V{y1 - 5:.1f}q0 5 5 5H{x1:.1f}"
    return f'<path d="{curve}" fill="none" stroke="{WIRE}" stroke-width="1.5"/>'


def _arrow(arrow: Arrow, color: str) -> str:
    """Draw an arrow from the lower left of the source, along its lane, to the first trigger line of the target."""
    source, target = arrow.source, arrow.target
    y0 = source.y + source.height - 9.0
    y1 = target.middle + LEADING + 4.0 if target.text_lines else target.middle + 6.0
    turn = 6.0 if y1 > y0 else -6.0
    curve = (
        f"M{source.x:.1f} {y0:.1f}H{arrow.lane + 6:.1f}q-6 0 -6 {turn:.1f}V{y1 - turn:.1f}q0 {turn:.1f} 6 {turn:.1f}"
        f"H{target.x:.1f}"
    )
    title = f"{target.title} depends on {source.title}"
    return (
        f'<g class="arrow"><title>{escape(title)}</title><path d="{curve}" fill="none" stroke="{color}" '
        f'marker-end="url(#tip)"/><circle cx="{source.x:.1f}" cy="{y0:.1f}" r="2.6" fill="{color}"/></g>'
    )


def _text(
    x: float,
    y: float,
    text: str,
    *,
    size: float = TEXT,
    weight: int = 400,
    color: str = INK,
    anchor: str = "start",
) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" font-weight="{weight}" fill="{color}" '
        f'text-anchor="{anchor}">{escape(text)}</text>'
    )
