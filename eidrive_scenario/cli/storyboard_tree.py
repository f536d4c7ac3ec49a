"""Human-readable tree of a storyboard: elements with their limits, triggers and actions."""

from __future__ import annotations

from rich.text import Text
from rich.tree import Tree

from eidrive_scenario.recording.text.run_log import describe_kind
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.storyboard.tree.elements import ManeuverGroupElement, StoryElement
from eidrive_scenario.storyboard.tree.events import ActionElement, EventElement


def storyboard_tree(storyboard: Storyboard) -> Tree:
    """Return the storyboard as a tree, with the actions of Init first."""
    root = Tree(Text(storyboard.scenario.name, style="bold"), guide_style="dim")
    init = root.add(_heading("init", "", ""))
    for behavior in storyboard.init.children:
        init.add(_action(behavior))
    _add(root, storyboard.root)
    return root


def _add(branch: Tree, element: StoryElement) -> None:
    name = "" if element.kind == "storyboard" else element.name
    node = branch.add(_heading(describe_kind(element.kind), name, _remarks(element)))
    for verb, leaf in (("starts", element.start_leaf), ("stops", element.stop_leaf)):
        if leaf is not None:
            node.add(Text.assemble((f"{verb} when ", "cyan"), leaf.trigger.describe() or "criteria end the run"))
    if isinstance(element, ActionElement):
        for behavior in element.children:
            node.add(_action(behavior))
    for child in element.elements:
        _add(node, child)


def _remarks(element: StoryElement) -> str:
    remarks = []
    if isinstance(element, EventElement):
        remarks.append(element.priority)
    if isinstance(element, EventElement | ManeuverGroupElement) and element.limit != 1:
        remarks.append(f"up to {element.limit} times")
    return ", ".join(remarks)


def _heading(kind: str, name: str, remarks: str) -> Text:
    parts = [(kind, "green"), (f" {name}" if name else "", "bold"), (f" ({remarks})" if remarks else "", "dim")]
    return Text.assemble(*parts)


def _action(behavior: object) -> Text:
    if not isinstance(behavior, ActionBehaviour):
        return Text(str(behavior))
    actor = f"{behavior.actor_name}: " if behavior.actor_name else ""
    return Text(f"{actor}{behavior.describe()}")
