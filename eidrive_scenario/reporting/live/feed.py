"""Events of a run for the pages that show it, independent of the speed of their connections."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_BATCH = 128
"""Maximum number of events that are passed on together."""


class Client:
    """Connected page, with the number of events that were sent to it."""

    def __init__(self, position: int) -> None:
        self.position = position


class Feed:
    """Server-sent events of one run. Each client receives all events in order, at its own speed.

    `add` never waits for a client. All methods may be called from any thread.
    """

    def __init__(self) -> None:
        self._events: list[bytes] = []
        self._clients: set[Client] = set()
        self._changed = threading.Condition()
        self._is_stopped = False

    def add(self, kind: str, data: object) -> None:
        """Append an event with an object of JSON."""
        text = json.dumps(data, separators=(",", ":"))
        with self._changed:
            self._events.append(f"id: {len(self._events)}\nevent: {kind}\ndata: {text}\n\n".encode())
            self._changed.notify_all()

    def next_events(self, client: Client, timeout: float) -> list[bytes] | None:
        """Return the next events of a client, empty after `timeout` [s] without one. Return None after the last one."""
        with self._changed:
            self._changed.wait_for(lambda: len(self._events) > client.position or self._is_stopped, timeout)
            found = self._events[client.position : client.position + _BATCH]
            if not found and self._is_stopped:
                return None
            return found

    def advance(self, client: Client, count: int) -> None:
        """Note that a number of events was sent to a client."""
        with self._changed:
            client.position += count
            self._changed.notify_all()

    @contextmanager
    def client(self, position: int) -> Iterator[Client]:
        """Count a client during the block, which has already received `position` events."""
        client = Client(position)
        with self._changed:
            self._clients.add(client)
            self._changed.notify_all()
        try:
            yield client
        finally:
            with self._changed:
                self._clients.discard(client)
                self._changed.notify_all()

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def wait_for_client(self, timeout: float | None) -> bool:
        """Wait until a client is connected, at most `timeout` [s]. Return whether one is."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._clients), timeout)

    def wait_until_alone(self) -> None:
        """Wait until no client is connected."""
        with self._changed:
            while self._clients:
                self._changed.wait(1.0)  # a wait without a timeout cannot be interrupted on Windows

    def stop(self, timeout: float) -> None:
        """End the connections once all events are sent, and wait for that at most `timeout` [s]."""
        deadline = time.monotonic() + timeout
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._clients, max(0.0, deadline - time.monotonic()))
