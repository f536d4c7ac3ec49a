"""Approximate width of text in a sans serif font, for line wrapping without a browser."""

from __future__ import annotations

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
