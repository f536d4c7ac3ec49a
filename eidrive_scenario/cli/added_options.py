"""Options of several commands: driving stacks, controllers, planner, criteria, and the runs whose recording is kept."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from eidrive_scenario.cli.short_help import rare

UserValues = Annotated[list[str] | None, rare(metavar="K=V", help="Value for UserDefinedValueConditions; repeatable.")]
Controllers = Annotated[
    list[str] | None,
    rare(metavar="K=V", help="Model V, such as alks, of controller K of another tool; repeatable."),
]
AllowTorchscript = Annotated[
    bool,
    rare(
        "--allow-torchscript",
        envvar="EIDRIVE_ALLOW_TORCHSCRIPT",
        help="Load TorchScript weights, which can execute any code with your permissions.",
    ),
]
NoCriteria = Annotated[bool, rare("--no-criteria", help="Accept runs that no criterion judges: they pass.")]
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
