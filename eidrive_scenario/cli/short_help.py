"""Help that fits on a screen: rarely used options are named in it, and described by `--help-all`."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

RARE = "Further options"
"""Panel of the options that only `--help-all` describes."""
rare = partial(typer.Option, rich_help_panel=RARE)
"""Define an option of this panel, as `typer.Option` does."""
_DESCRIBED = "eidrive_scenario.cli.short_help"
"""Key of the context under which `--help-all` is stored."""


class ShortHelp(TyperCommand):
    """Command whose help names the options of panel `RARE` in its last lines, and describes them with `--help-all`."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        hidden = [option for option in self.params if getattr(option, "rich_help_panel", None) == RARE]
        described = bool(ctx.meta.get(_DESCRIBED))
        for option in hidden:
            option.hidden = not described  # type: ignore[attr-defined]
        names = " ".join(option.opts[0] for option in hidden)
        self.epilog = None if described else f"{RARE} (see --help-all): {names}"
        super().format_help(ctx, formatter)


def _describe_all(ctx: typer.Context, requested: bool) -> None:
    if requested:
        ctx.meta[_DESCRIBED] = True
        typer.echo(ctx.get_help())
        raise typer.Exit


HelpAll = Annotated[
    bool, typer.Option("--help-all", callback=_describe_all, is_eager=True, help="Show all options and exit.")
]
"""Option of commands of the class `ShortHelp`."""
