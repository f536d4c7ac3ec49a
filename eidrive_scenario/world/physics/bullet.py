"""Import of pybullet without its build message."""

from __future__ import annotations

import os
import sys
from typing import Any

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.files.bounded import file_in_memory

_NOTICE = b"pybullet build time:"


def _import_silently() -> Any:
    """Import pybullet while file descriptor 2 refers to a file in memory. Other output is passed on.

    The message is printed by C code, which `contextlib.redirect_stderr` does not affect.
    """
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # Without a standard error of the process there is no message to suppress.
        import pybullet

        return pybullet
    with file_in_memory() as caught:
        os.dup2(caught.fileno(), 2)
        try:
            import pybullet
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            caught.seek(0)
            other = b"".join(line for line in caught if not line.startswith(_NOTICE))
            if other:
                os.write(2, other)
    return pybullet


bullet: Any = _import_silently()


_idle: list[int] = []
"""Clients of closed worlds that the next world uses. To connect takes several times as long as to empty a client."""
_MOST_IDLE = 1


def connect() -> int:
    """Return a client without a window and without bodies. Raise SimulationError if pybullet has no free client."""
    try:
        return _idle.pop()
    except IndexError:
        client: int = bullet.connect(bullet.DIRECT)
    if client < 0:
        raise SimulationError("pybullet gives no further client: close the worlds that are no longer used")
    return client


def disconnect(client: int) -> None:
    """Free a client with all its bodies. An emptied client is kept for the next world."""
    if len(_idle) < _MOST_IDLE:
        bullet.resetSimulation(physicsClientId=client)
        _idle.append(client)
    else:
        bullet.disconnect(physicsClientId=client)
