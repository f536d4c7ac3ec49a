"""Match of the children of an element with the order and number in its content model.

A content model is converted to an automaton by Glushkov's construction, with one state for each occurrence of a name;
XML Schema requires that each model is deterministic. The states give the expected children if a match fails.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise

import msgspec


class Leaf(msgspec.Struct, frozen=True):
    """Child by its name, between `minimum` and `maximum` times; None for no limit."""

    name: str
    minimum: int
    maximum: int | None


class Group(msgspec.Struct, frozen=True):
    """Sequence or choice of parts, optional or repeated as a whole."""

    parts: tuple[Leaf | Group, ...]
    exclusive: bool
    optional: bool = False
    repeated: bool = False


class Automaton(msgspec.Struct):
    """Automaton with state 0 before the first child; `steps` maps the name of the next child to the next state."""

    steps: list[dict[str, int]] = msgspec.field(default_factory=lambda: [{}])
    accepting: set[int] = msgspec.field(default_factory=set)
    distances: dict[int, int] = msgspec.field(default_factory=dict)
    """Minimum number of children from each state to an accepting state."""

    def __post_init__(self) -> None:
        self.distances = self._distances()

    def after(self, state: int, name: str) -> int:
        """Return the state after a child of that name; for a misplaced child, the next state that it may reach."""
        following = self.steps[state].get(name)
        if following is not None:
            return following
        entrances = {step[name] for step in self.steps if name in step}
        return min((to for to in entrances if to > state), default=min(entrances))

    def skipped(self, state: int, name: str) -> tuple[str, ...] | None:
        """Return the minimum children required before a child of that name; None if it is not allowed any more."""
        paths: dict[int, tuple[str, ...]] = {state: ()}
        queue = deque([state])
        while queue:
            current = queue.popleft()
            if name in self.steps[current]:
                return paths[current]
            for label, to in self.steps[current].items():
                if to not in paths:
                    paths[to] = (*paths[current], label)
                    queue.append(to)
        return None

    def missing(self, state: int) -> list[tuple[str, ...]]:
        """Return the alternatives for each of the minimum children that must follow."""
        distance = self.distances
        needed: list[tuple[str, ...]] = []
        while distance[state] > 0:
            nearer = {name: to for name, to in self.steps[state].items() if distance[to] == distance[state] - 1}
            needed.append(tuple(nearer))
            state = min(nearer.values())
        return needed

    def _distances(self) -> dict[int, int]:
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


class _Piece(msgspec.Struct):
    """Part of the automaton: its first and last states, and whether it may be empty."""

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
        pieces = [self.piece(member) for member in part.parts]
        group = self._alternatives(pieces) if part.exclusive else self._chain(pieces)
        if part.repeated:
            self._link(group.last, group.first)
        return _Piece(group.empty or part.optional, group.first, group.last)

    def _leaf(self, leaf: Leaf) -> _Piece:
        copies = [self._state(leaf.name) for _ in range(max(leaf.minimum, 1))]
        for before, after in pairwise(copies):
            self._link([before], [after])
        if leaf.maximum is None:
            self._link([copies[-1]], [copies[-1]])
        return _Piece(leaf.minimum == 0, copies[:1], copies[-1:])

    def _chain(self, pieces: list[_Piece]) -> _Piece:
        chain = _Piece(True, [], [])
        for piece in pieces:
            self._link(chain.last, piece.first)
            chain = _Piece(
                chain.empty and piece.empty,
                chain.first + piece.first if chain.empty else chain.first,
                chain.last + piece.last if piece.empty else piece.last,
            )
        return chain

    @staticmethod
    def _alternatives(pieces: list[_Piece]) -> _Piece:
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
    """Build the automaton of a content model."""
    builder = _Builder()
    root = builder.piece(model)
    builder.follow[0] = root.first
    steps = [{builder.names[to]: to for to in following} for following in builder.follow]
    return Automaton(steps, set(root.last) | ({0} if root.empty else set()))
