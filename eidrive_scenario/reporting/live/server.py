"""Local server of the page of a run in progress. It is reachable from this machine only."""

from __future__ import annotations

import json
import logging
import re
import secrets
import selectors
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any
from urllib.parse import urlsplit

from eidrive_scenario.errors import Diagnostic, SettingError

_BATCH = 128
"""Maximum number of events that are passed on together."""


class Feed:
    """Server-sent events of one run. Each client receives all events in order, at its own speed.

    clients  number of connected clients

    `add` never waits for a client. All methods may be called from any thread.
    """

    def __init__(self) -> None:
        self._events: list[bytes] = []
        self.clients = 0
        self._changed = threading.Condition()
        self._is_stopped = False

    def add(self, kind: str, data: object) -> None:
        """Append an event with an object of JSON."""
        text = json.dumps(data, separators=(",", ":"))
        with self._changed:
            self._events.append(f"id: {len(self._events)}\nevent: {kind}\ndata: {text}\n\n".encode())
            self._changed.notify_all()

    def next_events(self, position: int, timeout: float) -> list[bytes] | None:
        """Return the events after the first `position`, none after `timeout` [s] without one; None after the last."""
        with self._changed:
            self._changed.wait_for(lambda: len(self._events) > position or self._is_stopped, timeout)
            events = self._events[position : position + _BATCH]
            return None if not events and self._is_stopped else events

    @contextmanager
    def connected(self) -> Iterator[None]:
        """Count a client during the block."""
        self._count(1)
        try:
            yield
        finally:
            self._count(-1)

    def _count(self, change: int) -> None:
        with self._changed:
            self.clients += change
            self._changed.notify_all()

    def wait_for_client(self, timeout: float | None) -> bool:
        """Wait until a client is connected, at most `timeout` [s]. Return whether one is."""
        with self._changed:
            return self._changed.wait_for(lambda: self.clients > 0, timeout)

    def wait_until_alone(self) -> None:
        """Wait until no client is connected."""
        with self._changed:
            self._changed.wait_for(lambda: not self.clients)

    def stop(self, timeout: float) -> None:
        """End the connections once all events are sent, and wait for that at most `timeout` [s]."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self.clients, timeout)


HOST = "127.0.0.1"
SEND_TIMEOUT = 20.0
"""Time after which a client that reads nothing is disconnected [s]."""
HEARTBEAT = 0.5
"""Period of the check whether a page is still open [s]."""
MOST_CLIENTS = 32
"""Maximum number of pages at the same time."""
_LOCAL = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", re.IGNORECASE | re.ASCII)
"""Accepted Host headers. The port differs if it is forwarded by ssh."""
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; "
    "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}

_log = logging.getLogger(__name__)


class LiveServer(ThreadingHTTPServer):
    """HTTP server of one page and its events, in separate threads.

    page   function that returns the HTML of the page; it is called in a thread of the server
    port   TCP port; 0 for a free one

    Raise SettingError if the port cannot be used.
    """

    daemon_threads = True
    block_on_close = False

    def __init__(self, page: Callable[[], bytes], feed: Feed, *, port: int = 0) -> None:
        if not isinstance(port, int) or not 0 <= port <= 65535:
            raise SettingError(Diagnostic(f"port {port!r} does not exist", "give 1 to 65535, or 0 for a free one"))
        self.page, self.feed = page, feed
        self.token = secrets.token_urlsafe(16)
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            message = f"port {port} of {HOST} cannot be used: {error.strerror or error}"
            raise SettingError(Diagnostic(message, "give another port, or 0 for a free one")) from error
        self._thread = threading.Thread(
            target=self.serve_forever, kwargs={"poll_interval": 0.1}, name="eidrive live view", daemon=True
        )
        self._thread.start()

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"

    def stop(self) -> None:
        """Send the remaining events, and end the server. A second call has no effect."""
        if self._thread.is_alive():
            self.feed.stop(timeout=2.0)
            self.shutdown()
            self._thread.join()
            self.server_close()

    def server_bind(self) -> None:
        """Bind the socket without the search for a host name of HTTPServer, which may ask a name server."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = HOST, self.server_address[1]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore connections that end early; log other errors."""
        if not isinstance(sys.exc_info()[1], OSError):
            _log.warning("a request of the live view failed", exc_info=True)


class _Handler(BaseHTTPRequestHandler):
    server: LiveServer
    timeout = SEND_TIMEOUT
    server_version, sys_version = "eidrive", ""

    def do_GET(self) -> None:
        """Answer with the page or its events. Foreign hosts and addresses without the token get an error."""
        if not _LOCAL.fullmatch(self.headers.get("Host", "")):
            self.send_error(HTTPStatus.FORBIDDEN, "Host is not local")
            return
        try:
            path = urlsplit(self.path).path
        except ValueError:  # such as http://[
            self.send_error(HTTPStatus.BAD_REQUEST)
            return
        token, _, name = path.removeprefix("/").partition("/")
        if not secrets.compare_digest(token.encode(errors="replace"), self.server.token.encode()):
            self.send_error(HTTPStatus.NOT_FOUND)
        elif name == "":
            self._send_page()
        elif name == "events":
            self._send_events()
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _send_page(self) -> None:
        page = self.server.page()
        self._send_headers("text/html; charset=utf-8", len(page))
        self.wfile.write(page)

    def _send_events(self) -> None:
        feed = self.server.feed
        if feed.clients >= MOST_CLIENTS:
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE, "too many pages are open")
            return
        newest = self.headers.get("Last-Event-ID", "")
        position = int(newest) + 1 if re.fullmatch(r"\d{1,9}", newest, re.ASCII) else 0
        with feed.connected():
            self._send_headers("text/event-stream")
            while (events := feed.next_events(position, HEARTBEAT)) is not None and self._send(events):
                position += len(events)

    def _send(self, events: list[bytes]) -> bool:
        """Send events, or a comment without events. Return False if the page is closed."""
        with selectors.DefaultSelector() as selector:
            selector.register(self.connection, selectors.EVENT_READ)
            if selector.select(0.0) and not self.connection.recv(1, socket.MSG_PEEK):
                return False
        self.wfile.write(b"".join(events) or b":\n\n")
        return True

    def _send_headers(self, content_type: str, length: int | None = None) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", content_type)
        if length is not None:
            self.send_header("Content-Length", str(length))
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Print no line per request."""
