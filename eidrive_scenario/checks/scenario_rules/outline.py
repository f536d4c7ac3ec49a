"""Outline of a scenario for the rules: storyboard with catalog maneuvers, actors, placed entities and references."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import TypeVar

from lxml import etree

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.files.bounded import MIB, read_regular_file
from eidrive_scenario.files.yaml_text import is_inline
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.reading.document import VERSIONS
from eidrive_scenario.openscenario.reading.parsing import open_document
from eidrive_scenario.openscenario.reading.schema import rules
from eidrive_scenario.openscenario.scenario import EntitySelections, Scenario
from eidrive_scenario.openscenario.validation.names import LEVELS, ReferenceMatch
from eidrive_scenario.storyboard.kinematics.trailers import declared_trailer

E = TypeVar("E", bound=model.Element)
WORD = re.compile(r"\w+")
"""Pattern of words that may be names of parameters, variables or entities in the text of a command."""


@dataclass(eq=False)
class Node:
    """Element of the storyboard, with catalog references to maneuvers resolved; the root has no level."""

    element: model.Element
    level: model.StoryboardElementType | None
    path: tuple[str, ...]
    parent: Node | None
    children: list[Node] = field(default_factory=list)

    @property
    def title(self) -> str:
        """Return the name of the element for messages."""
        return f"{self.level.value} {self.path[-1]!r}" if self.level else "the storyboard"

    @property
    def start(self) -> model.Trigger | None:
        """Return the start trigger; None if the element starts with its parent, as without condition groups."""
        trigger = self.element.start_trigger if isinstance(self.element, model.Act | model.Event) else None
        return trigger if trigger is not None and trigger.condition_group else None

    @property
    def limit(self) -> int:
        """Return the maximum number of executions."""
        if (
            isinstance(self.element, model.Event | model.ManeuverGroup)
            and self.element.maximum_execution_count is not None
        ):
            return self.element.maximum_execution_count
        return 1

    def above(self) -> Iterator[Node]:
        """Yield the ancestors, the nearest first."""
        node = self.parent
        while node is not None:
            yield node
            node = node.parent

    def walk(self) -> Iterator[Node]:
        """Yield this element and its descendants."""
        yield self
        for child in self.children:
            yield from child.walk()

    def group(self) -> model.ManeuverGroup | None:
        """Return the maneuver group that contains this element."""
        for node in (self, *self.above()):
            if isinstance(node.element, model.ManeuverGroup):
                return node.element
        return None


class Outline:
    """Storyboard of a scenario, its entities and its references.

    added  criteria and driving stacks that the settings of the run add, YAML texts or files
    """

    def __init__(self, scenario: Scenario, added: tuple[str | Path, ...] = ()) -> None:
        self.scenario = scenario
        self.added = added
        self.root = Node(scenario.storyboard, None, ("storyboard",), None)
        self.root.children = [self._node(story, self.root, ()) for story in scenario.storyboard.story]
        self.nodes = tuple(self.root.walk())
        self._selections = EntitySelections(scenario)
        self._references = ReferenceMatch((node.path, node) for node in self.nodes)

    def _node(self, element: model.Element, parent: Node, above: tuple[str, ...]) -> Node:
        path = (*above, str(getattr(element, "name", "")))
        node = Node(element, LEVELS[type(element)], path, parent)
        for child in element.children():
            below = self.scenario.entries.get(child) if isinstance(child, model.CatalogReference) else child
            if type(below) in LEVELS and (below is child or isinstance(below, model.Maneuver)):
                node.children.append(self._node(below, node, path))
        return node

    def find(self, level: model.StoryboardElementType, reference: str) -> list[Node]:
        """Return the elements of a level to which a reference applies."""
        return [node for node in self._references.by(reference) if node.level is level]

    def members(self, name: str) -> tuple[str, ...]:
        """Return the entity of this name, or the members of the selection of this name."""
        try:
            return tuple(self._selections.members(name)) or (name,)
        except ScenarioError:  # a selection in itself, which the setup of the run reports
            return (name,)

    def actors(self, node: Node) -> tuple[str, ...]:
        """Return the actors of a storyboard element that the file lists."""
        group = node.group()
        names = [name for ref in (group.actors.entity_ref if group else ()) for name in self.members(ref.entity_ref)]
        return tuple(dict.fromkeys(names))

    def trajectory(self, action: model.FollowTrajectoryAction) -> model.Trajectory | None:
        """Return the trajectory of an action, also from a catalog; None if the entry is of another kind."""
        holder = action.trajectory_ref or action
        if holder.trajectory is not None or holder.catalog_reference is None:
            return holder.trajectory
        entry = self.scenario.entries.get(holder.catalog_reference)
        return entry if isinstance(entry, model.Trajectory) else None

    @cached_property
    def elements(self) -> tuple[model.Element, ...]:
        """Return all elements of the file and of the catalog entries that it uses."""
        trees = (self.scenario.document, *self.scenario.entries.values())
        return tuple(element for tree in trees for element in tree.walk())

    def of(self, kind: type[E]) -> Iterator[E]:
        """Yield the elements of a type."""
        return (element for element in self.elements if isinstance(element, kind))

    @cached_property
    def performances(self) -> tuple[tuple[model.PrivateAction, tuple[str, ...]], ...]:
        """Return every private action and its actors; those of Init first."""
        init = [
            (action, self.members(private.entity_ref))
            for private in self.scenario.storyboard.init.actions.private
            for action in private.private_action
        ]
        events = [
            (node.element.private_action, self.actors(node))
            for node in self.nodes
            if isinstance(node.element, model.Action) and node.element.private_action is not None
        ]
        return (*init, *events)

    @cached_property
    def trailers(self) -> frozenset[str]:
        """Return entities that another one tows; they are present with it."""
        trailers = map(declared_trailer, self.scenario.entities.values())
        return frozenset(name for name in trailers if name is not None)

    @cached_property
    def at_start(self) -> frozenset[str]:
        """Return the entities that Init places in the world, and those that the road network contains."""
        actions = self.scenario.storyboard.init.actions
        teleported = {
            name
            for private in actions.private
            if any(_is_placing(action) for action in private.private_action)
            for name in self.members(private.entity_ref)
        }
        added = {
            name
            for action in actions.global_action
            if action.entity_action is not None and action.entity_action.add_entity_action is not None
            for name in self.members(action.entity_action.entity_ref)
        }
        entities = self.scenario.document.entities
        objects = entities.scenario_object if entities else ()
        external = {entity.name for entity in objects if entity.external_object_reference is not None}
        return frozenset(teleported | added | external | self.trailers)

    @cached_property
    def placed(self) -> frozenset[str]:
        """Return the entities that are in the world at some time."""
        later = {name for action, actors in self.performances if _is_placing(action) for name in actors}
        added = {
            name
            for element in self.of(model.EntityAction)
            if isinstance(element.add_entity_action, model.AddEntityAction)
            for name in self.members(element.entity_ref)
        }
        return self.at_start | later | added

    @cached_property
    def referenced(self) -> dict[str, set[str]]:
        """Return the names to which elements refer, by kind ("entity", "variable", …)."""
        references: dict[str, set[str]] = {}
        for element in self.elements:
            for kind, name_field in _reference_fields(type(element)):  # type: ignore[arg-type]  # a class, not an element
                name = getattr(element, name_field, None)
                if isinstance(name, str):
                    references.setdefault(kind, set()).add(name)
        return references

    @cached_property
    def command_words(self) -> frozenset[str]:
        """Return all words in custom commands and added sources, which may use names in them."""
        texts = [command.content for command in self.of(model.CustomCommandAction)]
        texts += self.texts_of(self.added)
        return frozenset(word for text in texts for word in WORD.findall(text))

    def texts_of(self, sources: Iterable[str | Path]) -> list[str]:
        """Return YAML texts, and the contents of files that can be read."""
        texts = []
        for source in sources:
            if isinstance(source, str) and is_inline(source):
                texts.append(source)
                continue
            with suppress(OSError, ValueError):  # the setup of the run reports them
                texts.append(read_regular_file(source, MIB).decode(errors="replace"))
        return texts

    @cached_property
    def files(self) -> tuple[etree._Element, ...]:
        """Return the XML of the scenario with unresolved parameters, then of its catalogs; () without a text."""
        scenario = self.scenario.path or self.scenario.text
        if scenario is None:
            return ()
        catalogs = dict.fromkeys(entry.source for entry in self.scenario.entries.values())
        return tuple(open_document(source).root for source in (scenario, *map(Path, catalogs)))


def _is_placing(action: model.PrivateAction) -> bool:
    """Whether an action places its actor; an absent actor starts a trajectory at its first point."""
    return any(isinstance(below, model.TeleportAction | model.FollowTrajectoryAction) for below in action.walk())


@cache
def _reference_fields(cls: type[model.Element]) -> tuple[tuple[str, str], ...]:
    """Return the kinds to which attributes of a class refer in any version, and the names of their fields."""
    attributes = [rule for version in VERSIONS for rule in rules(cls, version).attributes.values()]
    return tuple(dict.fromkeys((rule.points_to, rule.field) for rule in attributes if rule.points_to))
