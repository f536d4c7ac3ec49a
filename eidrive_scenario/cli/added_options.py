"""Options of several commands: driving stacks, planner, criteria, and the runs whose recording is kept."""

from __future__ import annotations

from enum import StrEnum
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


class Keep(StrEnum):
    """Values of --record."""

    always = "always"
    on_failure = "on-failure"
    never = "never"
