"""Actions change the run by methods only: those of Actor and Motion, and those of the context."""

from __future__ import annotations

import ast
from pathlib import Path

import eidrive_behaviors

SOURCES = sorted(Path(eidrive_behaviors.__file__).parent.rglob("*.py"))
STATE = {"actor", "motion", "context", "actors", "commands", "signals", "traffic", "trailer", "other"}
"""Names under which behaviors refer to the state of the run."""


def assigned_attributes(tree: ast.AST) -> list[tuple[int, str]]:
    """Lines and targets of all assignments to attributes of the run's state."""
    found = []
    for node in ast.walk(tree):
        targets: list[ast.expr] = []
        if isinstance(node, ast.Assign):
            targets = node.targets
        elif isinstance(node, ast.AugAssign | ast.AnnAssign):
            targets = [node.target]
        for target in [inner for outer in targets for inner in ast.walk(outer)]:
            if not isinstance(target, ast.Attribute | ast.Subscript) or not isinstance(target.ctx, ast.Store):
                continue
            owner = ast.unparse(target.value).split("[")[0]
            if not STATE.isdisjoint(owner.split(".")):
                found.append((target.lineno, ast.unparse(target)))
    return found


def test_assignments_to_state_of_the_run_are_found() -> None:
    source = "self.actor.motion.speed = 1.0\ncontext.variables['a'], x = '1', 2\nself._x = 3\nself.context.dt += 1"
    lines = [line for line, _ in assigned_attributes(ast.parse(source))]
    assert lines == [1, 2, 4]


def test_behaviors_assign_no_state_of_the_run() -> None:
    assert len(SOURCES) > 30
    found = [(path.name, *hit) for path in SOURCES for hit in assigned_attributes(ast.parse(path.read_text()))]
    assert found == []
