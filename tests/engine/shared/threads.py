"""Functions in the main thread or in another one."""

from __future__ import annotations

import threading
from collections.abc import Callable


def run_in_thread(function: Callable[[], None], *, is_main: bool) -> None:
    """Call a function in the main thread, or in a new one and wait for its end."""
    if is_main:
        function()
        return
    thread = threading.Thread(target=function)
    thread.start()
    thread.join()
