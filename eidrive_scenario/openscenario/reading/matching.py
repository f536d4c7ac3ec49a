"""Match of the children of an element with the order and number in its content model.

A content model is converted to an automaton by Glushkov's construction, with one state for each occurrence of a name;
XML Schema requires that each model is deterministic. The states give the expected children if a match fails.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

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


class Automaton(msgspec.Struct, frozen=True):
    """Automaton with state 0 before the first child; `steps` maps the name of the next child to the next state."""

    steps: list[dict[str, int]]
    accepting: set[int]

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
        needed: list[tuple[str, ...]] = []
        while distance := self._distance(state):
            nearer = {name: to for name, to in self.steps[state].items() if self._distance(to) < distance}
            needed.append(tuple(nearer))
            state = min(nearer.values())
        return needed

    def _distance(self, state: int) -> int:
        """Return the minimum number of children up to an accepting state, which every state reaches."""
        count, reached = 0, {state}
        while reached.isdisjoint(self.accepting):
            count, reached = count + 1, {to for at in reached for to in self.steps[at].values()}
        return count


def automaton(model: Group) -> Automaton:
    """Build the automaton of a content model."""
    names: list[str] = [""]
    following: list[list[int]] = [[]]

    def link(before: Iterable[int], after: Iterable[int]) -> None:
        for state in before:
            following[state].extend(after)

    def add(part: Leaf | Group) -> tuple[bool, list[int], list[int]]:
        """Add the states of a part; return whether it may be empty, and its first and last states."""
        if isinstance(part, Leaf):
            copies = list(range(len(names), len(names) + max(part.minimum, 1)))
            names.extend(part.name for _ in copies)
            following.extend([after] for after in copies[1:])
            following.append(copies[-1:] if part.maximum is None else [])
            return part.minimum == 0, copies[:1], copies[-1:]
        members = [add(member) for member in part.parts]
        if part.exclusive:
            is_optional = not members or any(may_be_empty for may_be_empty, _, _ in members)
            first = [state for _, entrances, _ in members for state in entrances]
            last = [state for _, _, exits in members for state in exits]
        else:
            is_optional, first, last = True, [], []
            for may_be_empty, entrances, exits in members:
                link(last, entrances)
                first = first + entrances if is_optional else first
                last = last + exits if may_be_empty else exits
                is_optional = is_optional and may_be_empty
        if part.repeated:
            link(last, first)
        return is_optional or part.optional, first, last

    is_empty_allowed, following[0], last = add(model)
    steps = [{names[to]: to for to in targets} for targets in following]
    return Automaton(steps, {*last, 0} if is_empty_allowed else set(last))
