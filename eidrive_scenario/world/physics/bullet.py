"""pybullet, imported without the line that it prints about its build."""

from __future__ import annotations

import os
import sys
from typing import Any

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.files.bounded import file_in_memory

_NOTICE = b"pybullet build time:"


def _import_silently() -> Any:
    """Import pybullet while the file descriptor 2 points to a file in memory; what else came there is passed on.

    The notice is printed by C code, so that `contextlib.redirect_stderr` does not reach it.
    """
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # the process has no standard error; nothing to silence
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


def connect() -> int:
    """Return a new client without a window. Raise SimulationError when pybullet has no more to give."""
    client: int = bullet.connect(bullet.DIRECT)
    if client < 0:
        raise SimulationError("pybullet gives no further client: close the worlds that are no longer used")
    return client


def disconnect(client: int) -> None:
    """Free a client with all its bodies."""
    bullet.disconnect(physicsClientId=client)
