"""How wide text is in a sans serif font, near enough to break lines without a browser."""

from __future__ import annotations

_NARROW = frozenset("iljtfrI.,:;'|!()[]/ ")
_WIDE = frozenset("mwMW@%≥≤±→")


def width_of(text: str, size: float) -> float:
    """The width of a text [px] at a font size [px]."""
    return size * sum(_share(letter) for letter in text)


def _share(letter: str) -> float:
    """Of the font size, between Helvetica and the wider DejaVu Sans."""
    if letter in _NARROW:
        return 0.35
    if letter in _WIDE:
        return 0.92
    return 0.7 if letter.isupper() else 0.59


def broken(text: str, width: float, size: float) -> list[str]:
    """A text in lines no wider than `width` [px]; too long a word is cut, where its parts begin if it can."""
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
    """The number of letters at the beginning of a word that fit, at least 1; the time does not grow with the rest."""
    total = 0.0
    for count, letter in enumerate(word):
        total += _share(letter)
        if size * total > width:
            return max(count, 1)
    return len(word)


def _part(word: str, most: int) -> str:
    """At most so many letters of a word: up to a capital or behind an underscore, else all of them."""
    seams = (
        n
        for n in range(most, most // 2, -1)
        if word[n - 1] in "_-/." or (word[n].isupper() and not word[n - 1].isupper())
    )
    return word[: next(seams, most)]
