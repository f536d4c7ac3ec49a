"""A line chart as SVG: crisp, small, with its labels beside the lines instead of in a box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

WIDTH, HEIGHT = 1100.0, 300.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 140.0, 14.0, 42.0
INK, GRID, TEXT, PAPER = "var(--axis, #475569)", "var(--line, #e5e7eb)", "var(--text, #334155)", "var(--paper, #fff)"
"""Colors of the page around it, in which light and dark differ; each with the one for where there is no page."""


@dataclass(frozen=True)
class ChartSeries:
    """One line of a chart: points (x, y), and a mark at one of them (its index) if wanted."""

    name: str
    color: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    dashes: str = ""
    mark: int | None = None


def line_chart(
    lines: Sequence[ChartSeries],
    *,
    x_title: str,
    y_title: str,
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
) -> str:
    """The lines in one frame with axes from nice numbers."""
    x_low, x_high = x_range or _extent([value for line in lines for value in line.x])
    y_low, y_high = y_range or (0.0, _extent([value for line in lines for value in line.y])[1])

    def at(x: float, y: float) -> tuple[float, float]:
        across = (x - x_low) / ((x_high - x_low) or 1.0)
        up = (y - y_low) / ((y_high - y_low) or 1.0)
        return LEFT + across * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - up * (HEIGHT - TOP - BOTTOM)

    right, floor = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = []
    for value in ticks(y_low, y_high, 5):
        _, y = at(x_low, value)
        parts.append(f'<line x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}" style="stroke:{GRID}"/>')
        parts.append(_text(LEFT - 8, y + 4, f"{value:g}", "end"))
    for value in ticks(x_low, x_high, 9):
        x, _ = at(value, y_low)
        parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{floor}" y2="{floor + 5}" style="stroke:{INK}"/>')
        parts.append(_text(x, floor + 19, f"{value:g}", "middle"))
    parts.append(f'<line x1="{LEFT}" x2="{right}" y1="{floor}" y2="{floor}" style="stroke:{INK}"/>')
    parts.append(_text((LEFT + right) / 2, HEIGHT - 5, x_title, "middle"))
    middle = (TOP + floor) / 2
    parts.append(f'<g transform="translate(13 {middle:.1f}) rotate(-90)">{_text(0.0, 0.0, y_title, "middle")}</g>')
    ends = []
    for line in sorted(lines, key=lambda line: bool(line.dashes)):  # a broken line shows the one that it lies upon
        path, last, before = "", None, False
        for x, y in zip(line.x, line.y, strict=True):
            inside = x_low <= x <= x_high and y_low <= y <= y_high
            if inside:
                path += "{}{:.1f} {:.1f}".format("L" if before else "M", *at(x, y))
                last = (x, y)
            before = inside
        if last is None:
            continue
        dashes = f' stroke-dasharray="{line.dashes}"' if line.dashes else ""
        parts.append(
            f'<path d="{path}" fill="none" stroke="{line.color}" stroke-width="2.2" stroke-linejoin="round"{dashes}/>'
        )
        if line.mark is not None:
            x, y = at(line.x[line.mark], line.y[line.mark])
            parts.append(
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" fill="{line.color}" style="stroke:{PAPER}" '
                'stroke-width="1.5"/>'
            )
        ends.append((at(*last), line))
    parts.extend(_names(ends))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" '
        f'font-size="12.5" style="fill:{TEXT}"><title>{escape(y_title)} over {escape(x_title)}</title>'
        f"{''.join(parts)}</svg>"
    )


def ticks(low: float, high: float, most: int) -> list[float]:
    """At most `most` + 1 round numbers (1, 2 or 5 times a power of ten apart) from `low` to `high`."""
    span = high - low
    if span <= 0:
        return [low]
    power = 10.0 ** math.floor(math.log10(span / most))
    step = next(power * factor for factor in (1, 2, 5, 10) if span / (power * factor) <= most + 1e-9)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(index * step, 10) for index in range(first, last + 1)]


def _names(ends: Sequence[tuple[tuple[float, float], ChartSeries]]) -> list[str]:
    """The lines' names where they end, pushed apart where they would overlap."""
    drawn, last = [], -math.inf
    for (x, y), line in sorted(ends, key=lambda end: end[0][1]):
        last = max(y, last + 16)
        drawn.append(
            f'<path d="M{x + 3:.1f} {y:.1f}L{WIDTH - RIGHT + 10:.1f} {last:.1f}" stroke="{line.color}" '
            'stroke-width="1" fill="none" opacity="0.6"/>'
            f'<text x="{WIDTH - RIGHT + 14:.1f}" y="{last + 4:.1f}" fill="{line.color}" font-weight="600">'
            f"{escape(line.name)}</text>"
        )
    return drawn


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _extent(values: Sequence[float]) -> tuple[float, float]:
    return (min(values), max(values)) if values else (0.0, 1.0)
