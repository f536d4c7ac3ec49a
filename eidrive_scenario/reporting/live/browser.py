"""Opening of a page in the default browser."""

from __future__ import annotations

import subprocess
import sys
import threading
from subprocess import DEVNULL


def open_in_browser(address: str) -> None:
    """Open an address in the default browser, if there is one, without waiting.

    A separate process keeps output of the browser off the terminal, and the interruption of this process off the
    browser. A browser for terminals ends, as it has no terminal. The variable BROWSER selects another program.
    """
    if sys.executable:
        threading.Thread(target=_open, args=(address,), name="eidrive browser", daemon=True).start()


def _open(address: str) -> None:
    command = [sys.executable, "-I", "-m", "webbrowser", address]
    subprocess.run(command, stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL, start_new_session=True, check=False)
