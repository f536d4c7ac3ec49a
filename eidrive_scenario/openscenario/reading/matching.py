"""Whether the children of an element stand in the order and number that its content model says.

A content model becomes an automaton (Glushkov's construction: one state for each place of a name in the model), as
XML Schema's rules make every model deterministic. Places tell what would have been right where the automaton is stuck.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise


@dataclass(frozen=True)
class Leaf:
    """A child by its name, between `minimum` and `maximum` times; None is without limit."""

    name: str
    minimum: int
    maximum: int | None


@dataclass(frozen=True)
class Group:
    """Parts in order, or one of the parts; the whole may be left out, or repeated."""

    parts: tuple[Leaf | Group, ...]
    exclusive: bool
    optional: bool = False
    repeated: bool = False


@dataclass
class Automaton:
    """State 0 is before the first child; `steps` leads on by the next child's name."""

    steps: list[dict[str, int]] = field(default_factory=lambda: [{}])
    accepting: set[int] = field(default_factory=set)

    def after(self, state: int, name: str) -> int:
        """The state after a child of that name: by the model, or else as if it stood where it may."""
        entrances = {step[name] for step in self.steps if name in step}
        return self.steps[state].get(name, min((to for to in entrances if to > state), default=min(entrances)))

    def skipped(self, state: int, name: str) -> tuple[str, ...] | None:
        """The fewest children that have to stand before a child of that name; None if none would let it stand."""
        paths: dict[int, tuple[str, ...]] = {state: ()}
        queue = deque([state])
        while queue:
            at = queue.popleft()
            if name in self.steps[at]:
                return paths[at]
            for through, to in self.steps[at].items():
                if to not in paths:
                    paths[to] = (*paths[at], through)
                    queue.append(to)
        return None

    def missing(self, state: int) -> list[tuple[str, ...]]:
        """What has to follow at least: for each further child, the names of which one has to stand there."""
        distance = self._distances()
        needed: list[tuple[str, ...]] = []
        while distance[state] > 0:
            nearer = {name: to for name, to in self.steps[state].items() if distance[to] == distance[state] - 1}
            needed.append(tuple(nearer))
            state = min(nearer.values())
        return needed

    def _distances(self) -> dict[int, int]:
        """For each state, how many children it is away from an end."""
        into: dict[int, set[int]] = {}
        for state, step in enumerate(self.steps):
            for to in step.values():
                into.setdefault(to, set()).add(state)
        distance = dict.fromkeys(self.accepting, 0)
        queue = deque(self.accepting)
        while queue:
            state = queue.popleft()
            for before in into.get(state, ()):
                if before not in distance:
                    distance[before] = distance[state] + 1
                    queue.append(before)
        return distance


@dataclass
class _Piece:
    """A part of the automaton: the states where it begins and ends, and whether it may be empty."""

    empty: bool
    first: list[int]
    last: list[int]


class _Builder:
    def __init__(self) -> None:
        self.names: list[str] = [""]
        self.follow: list[list[int]] = [[]]

    def piece(self, part: Leaf | Group) -> _Piece:
        if isinstance(part, Leaf):
            return self._leaf(part)
        made = [self.piece(one) for one in part.parts]
        whole = self._either(made) if part.exclusive else self._chain(made)
        if part.repeated:
            self._link(whole.last, whole.first)
        return _Piece(whole.empty or part.optional, whole.first, whole.last)

    def _leaf(self, leaf: Leaf) -> _Piece:
        copies = [self._state(leaf.name) for _ in range(max(leaf.minimum, 1))]
        for before, after in pairwise(copies):
            self._link([before], [after])
        if leaf.maximum is None:
            self._link([copies[-1]], [copies[-1]])
        return _Piece(leaf.minimum == 0, copies[:1], copies[-1:])

    def _chain(self, pieces: list[_Piece]) -> _Piece:
        whole = _Piece(True, [], [])
        for piece in pieces:
            self._link(whole.last, piece.first)
            whole = _Piece(
                whole.empty and piece.empty,
                whole.first + piece.first if whole.empty else whole.first,
                whole.last + piece.last if piece.empty else piece.last,
            )
        return whole

    @staticmethod
    def _either(pieces: list[_Piece]) -> _Piece:
        return _Piece(
            not pieces or any(piece.empty for piece in pieces),
            [state for piece in pieces for state in piece.first],
            [state for piece in pieces for state in piece.last],
        )

    def _state(self, name: str) -> int:
        self.names.append(name)
        self.follow.append([])
        return len(self.names) - 1

    def _link(self, before: list[int], after: list[int]) -> None:
        for state in before:
            self.follow[state].extend(after)


def automaton(model: Group) -> Automaton:
    """The automaton of a content model."""
    builder = _Builder()
    whole = builder.piece(model)
    builder.follow[0] = whole.first
    steps = [{builder.names[to]: to for to in following} for following in builder.follow]
    return Automaton(steps, set(whole.last) | ({0} if whole.empty else set()))
