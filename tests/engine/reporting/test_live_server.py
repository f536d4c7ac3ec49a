"""Server of the live view: access, late and slow clients, end."""

from __future__ import annotations

import http.client
import json
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.reporting.live.server import Feed, LiveServer

PAGE = b"<h1>run</h1>"
PATIENCE = 20.0
"""Maximum time for which a test waits for another thread [s]."""


class Site:
    """Server of PAGE and a feed, with requests to it."""

    def __init__(self) -> None:
        self.feed = Feed()
        self.server = LiveServer(lambda: PAGE, self.feed)
        parts = urlsplit(self.server.address)
        self.port, self.path = parts.port or 0, parts.path

    def get(self, path: str, **headers: str) -> http.client.HTTPResponse:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        return connection.getresponse()

    def events(self, **headers: str) -> http.client.HTTPResponse:
        return self.get(self.path + "events", **headers)


@pytest.fixture
def site() -> Iterator[Site]:
    found = Site()
    yield found
    found.server.stop()


def read_events(response: http.client.HTTPResponse, count: int) -> list[object]:
    """Return the data of the next events."""
    found: list[object] = []
    while len(found) < count:
        line = response.readline()
        assert line, "the stream ended"
        if line.startswith(b"data: "):
            found.append(json.loads(line.removeprefix(b"data: ")))
    return found


def wait_for(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def test_page_is_not_stored_and_loads_nothing_from_elsewhere(site: Site) -> None:
    response = site.get(site.path)
    assert response.status == 200
    assert response.read() == PAGE
    assert response.getheader("Cache-Control") == "no-store"
    assert "default-src 'none'" in (response.getheader("Content-Security-Policy") or "")
    assert "frame-ancestors 'none'" in (response.getheader("Content-Security-Policy") or "")


@pytest.mark.parametrize("path", ["/", "/events", "/favicon.ico", "/guessed/", "/guessed/events", "/%C3%A9/", "/\xe9/"])
def test_address_without_token_is_not_found(site: Site, path: str) -> None:
    raw = socket.create_connection(("127.0.0.1", site.port), timeout=PATIENCE)
    raw.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{site.port}\r\n\r\n".encode("latin-1"))
    assert raw.recv(100).split()[1] == b"404"
    raw.close()


def test_invalid_address_is_a_bad_request(site: Site) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", site.port, timeout=PATIENCE)
    connection.putrequest("GET", "http://[", skip_host=True)
    connection.putheader("Host", "localhost")
    connection.endheaders()
    assert connection.getresponse().status == http.client.BAD_REQUEST


def test_other_names_below_the_token_are_not_found(site: Site) -> None:
    assert site.get(site.path + "../../etc/passwd").status == 404
    assert site.get(site.path.rstrip("/") + "x/").status == 404


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost@evil", ""])
def test_foreign_host_is_rejected(site: Site, host: str) -> None:
    """The page of another site could otherwise read the run by a name that resolves to 127.0.0.1."""
    assert site.get(site.path, Host=host).status == 403
    assert site.events(Host=host).status == 403


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "LOCALHOST:9000", "127.0.0.1:9000", "[::1]:9000"])
def test_local_host_with_forwarded_port_is_accepted(site: Site, host: str) -> None:
    assert site.get(site.path, Host=host).status == 200


def test_other_methods_are_rejected(site: Site) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", site.port, timeout=PATIENCE)
    connection.request("POST", site.path, body=b"x")
    assert connection.getresponse().status == 501


def test_server_listens_on_one_loopback_address_only(site: Site) -> None:
    """A server on all addresses would accept 127.0.0.2 as well."""
    with pytest.raises((ConnectionRefusedError, TimeoutError)):
        socket.create_connection(("127.0.0.2", site.port), timeout=2.0)


def test_tokens_of_two_servers_differ(site: Site) -> None:
    other = Site()
    assert other.path != site.path
    assert len(site.path.strip("/")) >= 20
    other.server.stop()


def test_late_client_receives_all_events_in_order(site: Site) -> None:
    for number in range(300):
        site.feed.add("part", {"number": number})
    response = site.events()
    assert response.getheader("Content-Type") == "text/event-stream"
    assert read_events(response, 300) == [{"number": number} for number in range(300)]
    site.feed.add("part", {"number": 300})
    assert read_events(response, 1) == [{"number": 300}]


def test_client_that_connects_again_receives_newer_events_only(site: Site) -> None:
    for number in range(5):
        site.feed.add("part", number)
    assert read_events(site.events(Last_Event_ID="2"), 2) == [3, 4]
    assert read_events(site.events(Last_Event_ID="abc"), 1) == [0]


def test_two_clients_receive_the_same_events(site: Site) -> None:
    first, second = site.events(), site.events()
    for number in range(3):
        site.feed.add("part", number)
    assert read_events(first, 3) == read_events(second, 3) == [0, 1, 2]


def test_client_that_reads_nothing_delays_no_other(site: Site) -> None:
    """50 MB exceed the buffers of both sockets."""
    lazy = socket.create_connection(("127.0.0.1", site.port))
    lazy.sendall(f"GET {site.path}events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    assert site.feed.wait_for_client(PATIENCE)
    for number in range(50):
        site.feed.add("part", [number, "x" * 10**6])
    numbers = [event[0] for event in read_events(site.events(), 50) if isinstance(event, list)]
    assert numbers == list(range(50))
    lazy.close()


def test_closed_client_is_no_longer_counted(site: Site) -> None:
    response = site.events()
    assert wait_for(lambda: site.feed.clients == 1)
    response.close()
    assert wait_for(lambda: site.feed.clients == 0)
    site.feed.wait_until_alone()


def test_number_of_clients_is_limited(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eidrive_scenario.reporting.live.server.MOST_CLIENTS", 1)
    kept = site.events()
    assert wait_for(lambda: site.feed.clients == 1)
    assert site.events().status == 503
    kept.close()


def test_stop_sends_remaining_events_and_ends_the_stream(site: Site) -> None:
    response = site.events()
    assert wait_for(lambda: site.feed.clients == 1)
    site.feed.add("part", "last")
    site.server.stop()
    assert read_events(response, 1) == ["last"]
    assert not [line for line in response if line not in (b"\n", b":\n")]
    with pytest.raises(ConnectionRefusedError):
        site.get(site.path)


def test_port_in_use_raises_setting_error(site: Site) -> None:
    with pytest.raises(SettingError, match=rf"port {site.port} of 127\.0\.0\.1 cannot be used"):
        LiveServer(lambda: PAGE, Feed(), port=site.port)


@pytest.mark.parametrize(("port", "text"), [(70_000, "70000"), ("8080", "'8080'"), (None, "None")])
def test_port_that_does_not_exist_raises_setting_error(port: Any, text: str) -> None:
    with pytest.raises(SettingError, match=f"port {text} does not exist"):
        LiveServer(lambda: PAGE, Feed(), port=port)
