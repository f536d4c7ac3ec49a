"""Options of `eidrive run` for the live view."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager, nullcontext, suppress
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.short_help import rare
from eidrive_scenario.cli.streams import echo
from eidrive_scenario.errors import Diagnostic, SettingError

if TYPE_CHECKING:
    from eidrive_scenario.reporting.live.live_view import LiveView

Live = Annotated[bool, typer.Option("--live", help="Show the run in the browser while it is in progress.")]
LiveSpeed = Annotated[
    str | None,
    rare(metavar="FACTOR|max", help="Simulated seconds per second with --live.", show_default="1"),
]
LivePort = Annotated[
    int | None, rare(min=1, max=65535, metavar="PORT", help="Port of --live.", show_default="a free one")
]


def live_view(
    requested: bool, speed: str | None, port: int | None, *, several: str, to_stderr: bool
) -> AbstractContextManager[LiveView | None]:
    """Return the live view of a run, or a context of None if it is not requested.

    several    option that requests several runs; empty for a single run
    to_stderr  whether the address is printed to standard error

    Raise SettingError for an invalid option, several runs, and a port that cannot be used.
    """
    for option, value in (("--live-speed", speed), ("--live-port", port)):
        if value is not None and not requested:
            raise SettingError(Diagnostic(f"{option} without --live has no effect", "add --live"))
    if not requested:
        return nullcontext()
    if several:
        hint = "run one seed with --live; record several with --out, and read them by eidrive report"
        raise SettingError(Diagnostic(f"--live shows a single run (got {several})", hint))
    factor = _speed(speed)
    from eidrive_scenario.reporting.live.live_view import WAIT, LiveView

    def announce(address: str) -> None:
        echo(f"live view: {address}", err=to_stderr)
        echo(f"The run starts when the page is open, at the latest in {WAIT:g} s.", err=True)

    return LiveView(speed=factor, port=port or 0, wait=WAIT, announce=announce)


def wait_until_closed(view: LiveView | None) -> None:
    """Wait after the end of a run until its pages are closed or the user interrupts."""
    if view is None:
        return
    with suppress(KeyboardInterrupt):
        if view.clients:
            echo("The run has ended. Close the page or press Ctrl-C.", err=True)
            view.wait_until_closed()


def _speed(text: str | None) -> float:
    if text is None:
        return 1.0
    if text == "max":
        return math.inf
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if factor == 0.0:
        return math.inf
    if not 0.0 < factor < math.inf:
        raise SettingError(Diagnostic(f"--live-speed is {text!r}", "give a factor such as 0.5, or max"))
    return factor
