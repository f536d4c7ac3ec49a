"""Options that `eidrive run` and `eidrive check` share: driving stacks, planner and criteria."""

from __future__ import annotations

from typing import Annotated

import typer

Drive = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME[=STACK]",
        help="Give entity NAME a driving stack with the properties STACK (YAML or file).",
    ),
]
Planner = Annotated[str | None, typer.Option(help="Planner of all driven stations.", show_default=False)]
Criteria = Annotated[
    list[str] | None,
    typer.Option(metavar="YAML|FILE", help="Add criteria, such as '{collision: {of: Ego}}'; repeatable."),
]
