"""Observer that shows a run in the browser while it is in progress."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from numbers import Real
from subprocess import DEVNULL
from typing import TYPE_CHECKING, Any, Self

from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError, quoted
from eidrive_scenario.experiments.commands import command_of_source
from eidrive_scenario.experiments.reported_run import ReportedRun, parse_run
from eidrive_scenario.experiments.single_run import as_json_text
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.reporting.live.server import Feed, LiveServer
from eidrive_scenario.reporting.page import render_page
from eidrive_scenario.reporting.replay.frame_data import Data, ReplayBuilder, packed, replay_data
from eidrive_scenario.reporting.replay.light import LightChanges, parse_weather
from eidrive_scenario.reporting.replay.models import ActorModels
from eidrive_scenario.reporting.replay.page import (
    TEMPLATE,
    RunOfPage,
    decisive_instant,
    drawn_roads,
    page_values,
    run_title,
    station_settings,
    street_of,
)
from eidrive_scenario.reporting.run_report.settings_text import run_facts
from eidrive_scenario.simulation.recorded_outcome import bodies
from eidrive_scenario.simulation.result import RunResult

if TYPE_CHECKING:
    from eidrive_scenario.simulation.simulation import Simulation


def open_in_browser(address: str) -> None:
    """Open an address in the default browser, if there is one, without waiting.

    A separate process keeps output of the browser off the terminal, and the interruption of this process off the
    browser. A browser for terminals ends, as it has no terminal. The variable BROWSER selects another program.
    """
    if sys.executable:
        command = [sys.executable, "-I", "-m", "webbrowser", address]
        streams = {"stdin": DEVNULL, "stdout": DEVNULL, "stderr": DEVNULL}
        run = partial(subprocess.run, command, start_new_session=True, check=False, **streams)
        threading.Thread(target=run, name="eidrive browser", daemon=True).start()


_MAX_LAG = 0.25
"""Time that a slow run catches up at most [s]."""
_SLEEP = 0.5
"""Longest sleep without a return to the interpreter, which can then raise an interruption [s]."""


class Pace:
    """Delay of a run, so that `speed` simulated seconds take a second; `math.inf` is as fast as possible.

    A run that is slower than that is not delayed. Raise SettingError if the speed is not a number above 0.
    """

    def __init__(self, speed: float) -> None:
        if not _is_speed(speed):
            message = f"the speed of the live view is {quoted(speed)}"
            raise SettingError(Diagnostic(message, "give a factor above 0; infinity is as fast as possible"))
        self._speed = float(speed)
        self._start: float | None = None
        """Instant of the clock at which the simulated time was 0 [s]."""

    def delay(self, simulated: float) -> float:
        """Return the time until a simulated time is due [s], at least 0."""
        if math.isinf(self._speed):
            return 0.0
        now, due = time.monotonic(), simulated / self._speed
        if self._start is None or now - self._start - due > _MAX_LAG:
            self._start = now - due
        return max(0.0, self._start + due - now)

    def wait(self, simulated: float) -> None:
        """Sleep until a simulated time is due [s]."""
        while (left := self.delay(simulated)) > 0.0:
            time.sleep(min(left, _SLEEP))


def _is_speed(value: object) -> bool:
    # bool is a subclass of int, but True is not a factor
    return not isinstance(value, bool) and isinstance(value, Real) and float(value) > 0.0


WAIT = 5.0
"""Default of the maximum time for which the start of a run waits for a page [s]."""
_PERIOD = 0.04
"""Time between two events with frames [s]: one event per frame at the default time step and speed."""
_RELOAD = 2.0
"""Time in which a page that is reloaded connects again [s]."""
_FRAGMENTS = ("badge", "notices", "verdict")
"""Parts of the page that change during a run; each has a template and an element of its name."""


class LiveView:
    """Observer of one run whose frames appear in a page while the run is in progress.

    speed     simulated time per wall time; `math.inf` is as fast as possible
    port      TCP port of 127.0.0.1; 0 for a free one
    wait      time for which the start of the run waits for the first page [s]
    browser   whether the page is opened in the default browser
    announce  called with the address when the run begins; by default it is written to standard error

    Use it in a `with` block, which ends the server: `with LiveView() as live: run_file(source, observers=[live])`.
    The page contains all frames since the start, whenever it is opened. A slow or closed page has no effect on the run.

    Raise SettingError if the port cannot be used or the speed is invalid.
    """

    def __init__(
        self,
        *,
        speed: float = 1.0,
        port: int = 0,
        wait: float = WAIT,
        browser: bool = True,
        announce: Callable[[str], None] | None = None,
    ) -> None:
        self._pace = Pace(speed)
        self._wait, self._browser, self._announce = wait, browser, announce or _write_address
        self._report = DamageReport()
        self._builder: ReplayBuilder | None = None
        self._feed = Feed()
        self._values: dict[str, Any] = {}
        self._instants: Data = {"contact": None, "decisive": None}
        self._building = threading.RLock()
        """Lock of the frames that are not yet sent."""
        self._ended = threading.Event()
        self._server = LiveServer(self._render, self._feed, port=port)

    @property
    def address(self) -> str:
        """Address of the page, with a random part that other programs cannot guess."""
        return self._server.address

    @property
    def clients(self) -> int:
        """Number of open pages."""
        return self._feed.clients

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def begin(self, simulation: Simulation) -> None:
        """Announce the address, and wait for the first page. `Simulation` calls it before the first tick.

        Raise SimulationError if it was called for another run.
        """
        if self._builder is not None:
            raise SimulationError("the live view has shown a run; a second run needs a second LiveView")
        settings = json.loads(simulation.resolved.canonical)
        models = ActorModels(bodies(simulation.scenario), settings.get("stations"))
        light = LightChanges(parse_weather(settings.get("weather_profile")))
        self._builder = ReplayBuilder(self._report, station_settings(settings), models, light)
        run = RunOfPage(
            run_title(simulation.resolved.scenario, simulation.seed),
            run_facts(settings),
            settings,
            command_of_source(simulation.scenario, simulation.seed, simulation.settings),
            replay_data([]),
            result=None,
        )
        roads, street = drawn_roads(lambda: simulation.roads, self._report), street_of(lambda: simulation.roads)
        self._values = page_values(run, roads=roads, street=street, images={}, live=True)
        self._announce(self.address)
        if self._browser:
            open_in_browser(self.address)
        threading.Thread(target=self._send_regularly, name="eidrive live frames", daemon=True).start()
        self._feed.wait_for_client(self._wait)

    def observe(self, frame: Frame) -> None:
        """Add a frame, and delay the run until the next one is due.

        Raise SimulationError before `begin`.
        """
        if self._builder is None:
            raise SimulationError("the live view has not begun; it observes a Simulation, which calls begin")
        with self._building:
            self._builder.observe(frame)
        self._pace.wait(frame.view.time)

    def conclude(self, result: RunResult) -> None:
        """Show the verdicts. `Simulation.run` calls it at the end."""
        with self._building:
            if self._builder is not None:
                self._builder.observe_links(result.final_links)
        self._end(parse_run(json.loads(as_json_text(result))))

    def close(self) -> None:
        """End the run; without `conclude` the page states that the run was aborted. The page stays available."""
        self._end(None)

    def wait_until_closed(self) -> None:
        """Return when all pages are closed; at once if none is open."""
        while self._feed.clients:
            self._feed.wait_until_alone()
            self._feed.wait_for_client(_RELOAD)

    def stop(self) -> None:
        """End the server after the pages have received the remaining frames. A second call has no effect."""
        self._ended.set()
        self._server.stop()

    def _send_regularly(self) -> None:
        """Send frames until the run has ended. No connection delays the run."""
        while not self._ended.wait(_PERIOD):
            self._send_frames()

    def _send_frames(self) -> None:
        with self._building:
            if self._builder is None:
                return
            part = self._builder.take()
            self._instants = {key: part[key] for key in ("contact", "decisive")}
            if part["times"] or part["messages"]:
                self._feed.add("part", packed(part))
            if self._report.lines() != self._values["notices"]:
                self._values = {**self._values, "notices": self._report.lines()}
                self._send_page()

    def _end(self, result: ReportedRun | None) -> None:
        """Send the last frames and the result, None for an aborted run."""
        with self._building:
            if self._ended.is_set() or self._builder is None:
                return
            self._send_frames()
            self._ended.set()
            self._values = {**self._values, "result": result, "complete": result is not None}
            self._send_page()

    def _send_page(self) -> None:
        """Send the parts of the page around the frames."""
        values = self._values
        fragments = {name: render_page(f"replay/{name}.html.jinja", **values) for name in _FRAGMENTS}
        decisive = decisive_instant(self._instants, values["result"], self._builder.actors if self._builder else ())
        self._feed.add("page", {**fragments, "decisive": decisive, "ended": self._ended.is_set()})

    def _render(self) -> bytes:
        """Return the page without frames."""
        return render_page(TEMPLATE, **self._values).encode(errors="replace")


def _write_address(address: str) -> None:
    sys.stderr.write(f"live view: {address}\n")
    sys.stderr.flush()
