"""Replay and report in Chromium, opened from disk, and the live view of a run.

EIDRIVE_BROWSER names the program, for example /usr/bin/chromium; axe-playwright-python is required, too.
EIDRIVE_SCREENSHOTS names a folder for pictures of the pages.
"""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from command_fixtures import Eidrive
from opendrive_xml import map_xml, road_xml
from written_recording import detected, step, write_run
from written_recording import view as world_view

from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.reporting.live.live_view import LiveView
from eidrive_scenario.reporting.replay.page import make_replay
from eidrive_scenario.reporting.run_report.report import write_run_report

BROWSER = os.environ.get("EIDRIVE_BROWSER")
SCREENSHOTS = os.environ.get("EIDRIVE_SCREENSHOTS")
WIDTHS = {"phone": 390, "desktop": 1440}
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""WebGL without a graphics card."""
SERIOUS = ("serious", "critical")

pytestmark = pytest.mark.skipif(BROWSER is None, reason="EIDRIVE_BROWSER is not set")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    pytest.importorskip("axe_playwright_python")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", *SOFTWARE])
        yield chromium
        chromium.close()


@pytest.fixture
def report(eidrive: Eidrive, tmp_path: Path) -> Path:
    """Report of two runs with an RSU and a lossy channel, beside their replays."""
    for channel in ("ideal", "error_30pct"):
        done = eidrive(
            "run", "coop/scenario_1", "--detector", "oracle", "--channel", channel, "--out", f"{tmp_path}/runs"
        )
        assert done.exit_code == 0, done.output
    done = eidrive("report", f"{tmp_path}/runs", "--out", f"{tmp_path}/report")
    assert done.exit_code == 0, done.output
    return tmp_path / "report" / "report.html"


def _is_fault(kind: str, text: str) -> bool:
    # Without a graphics card, Chromium warns of copies from one canvas to another
    return kind in ("error", "warning") and "GPU stall due to ReadPixels" not in text


class Page:
    """Page of a browser with the messages of its console and its requests other than to files.

    site  address below which a live view may request
    script  executed before those of the page
    """

    def __init__(
        self,
        browser: Any,
        file: Path | None,
        width: int,
        *,
        dark: bool = False,
        address: str = "",
        site: str = "",
        height: int = 900,
        script: str = "",
    ) -> None:
        scheme = "dark" if dark else "light"
        self._context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
        self.page = self._context.new_page()
        self.page.add_init_script(script)
        self.faults: list[str] = []
        self.page.on("console", lambda message: self._note(_is_fault(message.type, message.text), message.text))
        self.page.on("pageerror", lambda error: self._note(True, str(error)))
        allowed = ("file:", "data:", "blob:", *([site] if site else []))
        self.page.on("request", lambda request: self._note(not request.url.startswith(allowed), request.url))
        self.page.goto((site if file is None else file.as_uri()) + address)

    def _note(self, is_fault: bool, text: str) -> None:
        if is_fault:
            self.faults.append(text)

    def time(self) -> float:
        """Return the shown instant [s]."""
        return float(self.page.inner_text("#clock").removesuffix(" s"))

    def wide(self) -> bool:
        """Return whether the page is wider than its window."""
        return bool(self.page.evaluate("document.documentElement.scrollWidth > window.innerWidth"))

    def close(self, name: str, *, full: bool = True) -> None:
        """Check the page, store a picture of all of it or of its window, and close it."""
        self.check(name, full=full)
        self._context.close()

    def check(self, name: str, *, full: bool = True) -> None:
        """Check for faults and accessibility, and store a picture of the full page or of its window."""
        from axe_playwright_python.sync_playwright import Axe

        found = Axe().run(self.page).response["violations"]
        assert not [fault["id"] for fault in found if fault["impact"] in SERIOUS]
        if SCREENSHOTS:
            self.page.screenshot(path=f"{SCREENSHOTS}/{name}.png", full_page=full)
        assert not self.faults

    def wait(self, condition: str) -> None:
        """Wait until an expression is true. The rules of a live view forbid `wait_for_function`, which compiles it."""
        end = time.monotonic() + 60.0
        while not self.page.evaluate(condition):
            assert time.monotonic() < end, condition
            self.page.wait_for_timeout(20)


def replay_of(report: Path, channel: str) -> Path:
    (found,) = (report.parent / "replays").glob(f"*{channel}*.html")
    return found


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("size", WIDTHS)
def test_pages_are_accessible_and_fit_the_window(browser: Any, report: Path, size: str, dark: bool) -> None:
    scheme = "dark" if dark else "light"
    for name, file in (("report", report), ("replay", replay_of(report, "error_30pct"))):
        page = Page(browser, file, WIDTHS[size], dark=dark)
        assert not page.wide(), name
        page.close(f"{name}-{size}-{scheme}")


def test_replay_opens_at_decisive_instant_and_plays_on(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 1440)
    decisive = float(page.page.inner_text("#decisive").split()[-2])
    assert page.time() == decisive
    page.page.click("#play")
    page.page.wait_for_function(f"shown.time > {decisive} + 0.5")
    page.page.keyboard.press("Escape")
    page.page.click("#play")
    stopped = page.time()
    page.page.wait_for_timeout(200)
    assert page.time() == stopped
    assert f"#t={stopped:g}" in page.page.url
    page.close("replay-played")


def test_replay_is_controlled_by_keyboard(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 1440, address="#t=3")
    keys = page.page.keyboard
    assert page.time() == 3.0
    keys.press("ArrowRight")
    assert page.time() == pytest.approx(3.05)
    keys.press("Shift+ArrowLeft")
    assert page.time() == pytest.approx(2.05)
    keys.press("Home")
    assert page.time() == 0.0
    for key, view in (("2", "follow"), ("3", "third"), ("4", "driver"), ("5", "orbit"), ("1", "top")):
        keys.press(key)
        assert page.page.input_value("#view") == view
    page.page.locator("#layers input").first.focus()
    keys.press("ArrowRight")
    assert page.time() == pytest.approx(0.05)
    page.page.locator("#slider").focus()
    keys.press(" ")
    assert page.page.inner_text("#play") == "Pause"
    keys.press(" ")
    page.close("replay-keyboard")


def test_slider_layers_and_links_of_replay_change_the_picture(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 1440, address="#t=3.9")
    picture = "document.getElementById('street').toDataURL()"
    before = page.page.evaluate(picture)
    page.page.get_by_label("received from RSU").uncheck()
    assert page.page.evaluate(picture) != before
    page.page.get_by_label("received from RSU").check()
    assert page.page.evaluate(picture) == before
    page.page.locator("#slider").fill("20")
    assert page.time() == pytest.approx(1.0)
    page.page.evaluate("location.hash = '#t=4.5'")
    page.page.wait_for_function("shown.time === 4.5")
    page.page.locator("#changes summary").first.click()
    assert page.time() == 0.0
    page.close("replay-controls")


PLACES = """[...document.querySelectorAll("#over-time .track, #over-time svg")].map((track) => {
  const { left, width } = track.getBoundingClientRect();
  return [Math.round(left), Math.round(width)];
})"""
TARGETS = """[...document.querySelectorAll("button, select, summary, label, input[type=range]")]
  .filter((target) => getComputedStyle(target).pointerEvents !== "none" && target.offsetParent)
  .filter((target) => !target.matches("label:has(select)"))
  .map((target) => {
    const { height, width } = target.getBoundingClientRect();
    return [target.id || target.textContent, height, width];
  })"""


def test_axis_charts_tracks_and_storyboard_of_replay_have_one_cursor(browser: Any, report: Path) -> None:
    for width in WIDTHS.values():
        page = Page(browser, replay_of(report, "error_30pct"), width, address="#t=3.9")
        places = page.page.evaluate(PLACES)
        assert len(places) > 10
        assert len({tuple(place) for place in places}) == 1
        left, wide = places[0]
        duration = float(page.page.evaluate("axis"))
        cursor = "document.getElementById('now').getBoundingClientRect()"
        at = page.page.evaluate(f"{cursor}.left + {cursor}.width / 2")
        assert at == pytest.approx(left + wide * 3.9 / duration, abs=1.0)
        page.page.locator("#charts .track").first.click(position={"x": wide / 2, "y": 30})
        assert page.time() == pytest.approx(duration / 2, abs=0.1)
        page.close("replay-cursor", full=False)


def test_messages_of_replay_follow_the_cursor_and_name_lost_ones(browser: Any, report: Path) -> None:
    """30 % of the messages are lost."""
    page = Page(browser, replay_of(report, "error_30pct"), 1440, address="#t=3.9")
    current = page.page.locator("#message-list tr[aria-current] td")
    assert current.all_inner_texts()[:2] == ["3.900 s", "RSU → Ego"]
    assert page.page.locator("#message-list tbody tr").count() < 40
    page.page.locator("#slider").fill("20")
    assert current.first.inner_text() == "1.000 s"
    sent, lost = (int(word) for word in page.page.inner_text("#message-count").split() if word.isdigit())
    assert 0.2 < lost / sent < 0.4
    page.page.get_by_label("lost ones only").check()
    page.page.locator("#message-list tbody button").nth(3).click()
    assert "lost: " in current.nth(4).inner_text()
    assert page.time() == float(current.first.inner_text().removesuffix(" s"))
    assert page.page.locator("#tracks .mark.lost").count() > 3
    assert page.page.evaluate("poseOf('sender that is no actor') === undefined")
    page.close("replay-messages")


def test_changes_of_one_instant_are_one_mark_with_their_number(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 1440)
    at_start = int(page.page.evaluate("data.changes.filter(([time]) => time === 0).length"))
    assert at_start > 1
    assert page.page.locator("#tracks .mark.change").first.inner_text() == str(at_start)
    assert page.page.locator("#changes summary").first.inner_text() == f"0.00 s {at_start} changes"
    page.close("replay-bundles")


def test_phone_has_large_targets_and_dark_mode_a_dark_map(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 390, dark=True)
    sizes = page.page.evaluate(TARGETS)
    assert len(sizes) > 20
    assert [size for size in sizes if min(size[1:]) < 44] == []
    pixel = "[...document.getElementById('street').getContext('2d').getImageData(3, 3, 1, 1).data].slice(0, 3)"
    assert max(page.page.evaluate(pixel)) < 90
    picture = "document.getElementById('street').toDataURL()"
    dark = page.page.evaluate(picture)
    page.page.emulate_media(color_scheme="light")
    page.wait(f"{picture} !== {dark!r}")
    page.close("replay-phone")


@pytest.fixture
def two_runs(eidrive: Eidrive, tmp_path: Path) -> Path:
    """Page of a run with latency, which ends early by a collision, under one without latency and another time step."""
    for name, *options in (("a", "latency_300ms"), ("b", "ideal", "--dt", "0.025")):
        channel, *others = options
        eidrive("run", "coop/scenario_1", "--channel", channel, "--seed", "1", *others, "--out", tmp_path / name)
    done = eidrive("view", tmp_path / "a", tmp_path / "b", "--out", tmp_path / "two.html")
    assert done.exit_code == 0, done.output
    return tmp_path / "two.html"


@pytest.mark.parametrize("size", WIDTHS)
def test_two_runs_have_one_cursor_until_the_longer_one_ends(browser: Any, two_runs: Path, size: str) -> None:
    page = Page(browser, two_runs, WIDTHS[size], address="#t=4.7", height=1460)
    assert page.time() == 4.7
    speed = page.page.locator("#charts b").first
    before = "data.poses.Ego[shown.index - 1][3].toFixed(2)"
    here = "other.poses.Ego[shown.otherIndex][3].toFixed(2)"
    assert speed.inner_text().split() == ["A", page.page.evaluate(before), "B", page.page.evaluate(here)]
    picture = "document.getElementById('street').toDataURL()"
    both = page.page.evaluate(picture)
    page.page.get_by_label("run B").uncheck()
    assert page.page.evaluate(picture) != both
    page.page.get_by_label("run B").check()
    assert page.page.inner_text("#known").count("15.3 m/s") == 1
    page.page.locator("h1").click()
    page.page.keyboard.press("End")
    assert page.time() == page.page.evaluate("Number(other.times[other.times.length - 1].toFixed(2))")
    assert page.page.is_visible("#end-A")
    assert not page.page.is_visible("#end-B")
    assert not page.wide()
    page.page.keyboard.press("d")
    page.close(f"two-runs-{size}", full=size == "phone")


def test_views_of_replay_show_different_pictures(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 1440, address="#t=3.9")
    pictures = set()
    for view in ("driver", "follow", "third", "top"):
        page.page.select_option("#view", view)
        pictures.add(page.page.evaluate("document.getElementById('street').toDataURL()"))
    assert len(pictures) == 4
    page.close("replay", full=False)


def colors(page: Page) -> int:
    """Return the number of colors of the street as shown."""
    picture = cv2.imdecode(np.frombuffer(page.page.locator("#street").screenshot(), np.uint8), cv2.IMREAD_COLOR)
    return len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0))


@pytest.mark.parametrize("size", WIDTHS)
def test_replay_draws_models_in_three_dimensions(browser: Any, report: Path, size: str) -> None:
    page = Page(browser, replay_of(report, "ideal"), WIDTHS[size], address="#t=3.9")
    views = page.page.eval_on_selector_all("#view option", "options => options.map((option) => option.value)")
    assert views == ["top", "follow", "third", "driver", "orbit", "camera 0"]
    for view in views[1:]:
        page.page.select_option("#view", view)
        page.wait("space.state === 'ready' && !space.isDue && [...space.models.values()].every(Boolean)")
        assert page.page.evaluate("space.renderer.info.render.triangles") > 5000
        assert colors(page) > 4000, view
        assert not page.wide()
        page.check(f"replay-3d-{view.replace(' ', '-')}-{size}", full=False)
    drawn = page.page.evaluate("space.renderer.info.render.frame")
    page.page.wait_for_timeout(300)
    assert page.page.evaluate("space.renderer.info.render.frame") == drawn
    page.close(f"replay-3d-{size}")


def test_orbit_turns_moves_and_zooms_by_pointer(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 1440, address="#t=3.9")
    page.page.select_option("#view", "orbit")
    page.wait("space.state === 'ready'")
    state = "[orbit.azimuth, orbit.elevation, topView.x, topView.y, topView.scale]"
    area, mouse = page.page.locator("#street").bounding_box(), page.page.mouse
    states = [page.page.evaluate(state)]
    for button, ahead in (("left", 0), ("right", 0), ("left", 240)):
        mouse.move(area["x"] + 300, area["y"] + 200)
        if ahead:
            mouse.wheel(0, -ahead)
        else:
            mouse.down(button=button)
            mouse.move(area["x"] + 360, area["y"] + 230)
            mouse.up(button=button)
        page.page.wait_for_timeout(50)
        states.append(page.page.evaluate(state))
    first, after_turn, after_move, after_zoom = states
    assert after_turn[:2] == pytest.approx([first[0] - 0.3, first[1] + 0.15])
    assert after_move[:2] == after_turn[:2]
    assert math.dist(after_move[2:4], after_turn[2:4]) == pytest.approx(math.hypot(60, 30) / first[4])
    assert after_zoom[4] == pytest.approx(first[4] * math.exp(240 / 600))
    page.close("replay-orbit", full=False)


def test_top_view_is_moved_and_zoomed_by_fingers(browser: Any, report: Path) -> None:
    """Fingers 100 px apart move to a distance of 150 px, and their middle moves by 25 px to the right."""
    page = Page(browser, replay_of(report, "ideal"), WIDTHS["phone"], address="#t=3.9")
    area, state = page.page.locator("#street").bounding_box(), "[topView.x, topView.y, topView.scale]"
    x, y = area["x"] + 100, area["y"] + 100
    page.page.evaluate("follow(false)")
    states = [page.page.evaluate(state)]
    devtools = page.page.context.new_cdp_session(page.page)
    for ends in ([[(0, 0)], [(60, 30)]], [[(0, 0), (100, 0)], [(0, 0), (150, 0)]]):
        for kind, points in zip(("touchStart", "touchMove"), ends, strict=True):
            touched = [{"x": x + dx, "y": y + dy, "id": number} for number, (dx, dy) in enumerate(points)]
            devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touched})
        devtools.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        page.page.wait_for_timeout(50)
        states.append(page.page.evaluate(state))
    first, after_move, after_zoom = states
    assert after_move == pytest.approx([first[0] - 60 / first[2], first[1] + 30 / first[2], first[2]])
    scale = 1.5 * first[2]
    assert after_zoom == pytest.approx([after_move[0] - 25 / scale, after_move[1], scale])
    page.close("replay-fingers", full=False)


NO_WEBGL = """HTMLCanvasElement.prototype.getContext = new Proxy(HTMLCanvasElement.prototype.getContext, {
  apply: (given, canvas, [kind, ...rest]) =>
    kind.startsWith("webgl") ? null : Reflect.apply(given, canvas, [kind, ...rest]) });"""


def test_replay_without_webgl_keeps_the_drawing_in_perspective(browser: Any, report: Path) -> None:
    page = Page(browser, replay_of(report, "ideal"), 1440, address="#t=3.9", script=NO_WEBGL)
    page.page.select_option("#view", "orbit")
    page.wait("space.state === 'failed' && shown.view === 'top'")
    views = page.page.eval_on_selector_all("#view option", "options => options.map((option) => option.value)")
    assert views == ["top", "follow", "third", "driver"]
    page.page.select_option("#view", "third")
    assert colors(page) > 1000
    page.page.keyboard.press("5")  # that of the orbit
    assert page.page.evaluate("[shown.view, element('view').value]") == ["third", "third"]
    page.faults = [fault for fault in page.faults if "WebGL" not in fault]  # three.js reports the missing context
    page.close("replay-without-webgl", full=False)


def test_replay_without_actors_shows_the_road_of_hundred_meters(browser: Any, tmp_path: Path) -> None:
    road = tmp_path / "road.xodr"
    road.write_text(map_xml(road_xml(length=100.0)))
    run = write_run(tmp_path, [Frame(world_view({}))], road=road)
    make_replay(run.recording, tmp_path / "empty.html")
    page = Page(browser, tmp_path / "empty.html", 1440)
    x, scale, width = page.page.evaluate("[topView.x, topView.scale, canvas.offsetWidth]")
    assert (x, scale) == (50.0, pytest.approx(width / (100.0 + 16.0)))
    page.close("replay-without-actors")


def test_charts_show_a_single_value_as_a_point(browser: Any, tmp_path: Path) -> None:
    """The speed 5 m/s is at the upper edge of its chart, 6 pixels below that of the picture."""
    run = write_run(
        tmp_path, [Frame(world_view({"Ego": {"velocity": (5.0, 0.0, 0.0)}}), {"Ego": step(detected(0.0, []))})]
    )
    make_replay(run.recording, tmp_path / "frame.html")
    page = Page(browser, tmp_path / "frame.html", 1440)
    assert page.page.evaluate("document.querySelector('.chart path').isPointInStroke(new DOMPoint(0, 6))")
    page.close("replay-of-one-frame")


def test_sensor_ranges_of_a_station_stay_when_another_leaves(browser: Any, tmp_path: Path) -> None:
    """The ranges of 20 and 30 m are circles with diameters of 40 and 60 m."""
    truth = {"truth": {"kind": "truth", "range": 20.0}}
    both = truth | {"lidar": {"kind": "lidar", "range": 30.0}}
    stations = {"First": {"detector": "oracle", "sensors": truth}, "Second": {"detector": "oracle", "sensors": both}}
    bodies = {name: {"position": (10.0 * number, 0.0, 0.0)} for number, name in enumerate(stations)}
    frames = [
        Frame(world_view(present, tick), {name: step(detected(0.1 * tick, [])) for name in present})
        for tick, present in enumerate([bodies, {"Second": bodies["Second"]}])
    ]
    run = write_run(tmp_path, frames, metadata={"settings": json.dumps({"stations": stations})})
    make_replay(run.recording, tmp_path / "leaving.html")
    page = Page(browser, tmp_path / "leaving.html", 1440, address="#t=0")
    page.page.select_option("#station", "")
    page.page.select_option("#view", "orbit")
    page.wait("space.state === 'ready' && space.sectors.size === 3")
    page.page.keyboard.press("ArrowRight")
    page.wait("space.sectors.size === 2")
    diameters = """[...space.sectors.values()].map(({ children: [, { geometry }] }) => {
      const { array } = geometry.attributes.position;
      let most = 0;
      for (let i = 0; i < array.length; i += 3)
        most = Math.max(most, Math.hypot(array[i] - array[0], array[i + 1] - array[1]));
      return Math.round(most);
    })"""
    assert sorted(page.page.evaluate(diameters)) == [40, 60]
    page.close("replay-of-leaving-station", full=False)


SCRUB = """async () => {
  const slider = document.getElementById("slider"), times = [];
  for (let step = 0; step < 200; step += 1) {
    const start = performance.now();
    slider.value = Math.round(slider.max * ((37 * step) % 200) / 200);
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    times.push(performance.now() - start);
    await new Promise(requestAnimationFrame);
  }
  return times.sort((one, other) => one - other);
}"""


def test_replay_of_forty_actors_is_small_and_prints_its_frame_times(
    browser: Any,
    eidrive: Eidrive,
    tmp_path: Path,
    record_property: Callable[[str, object], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """20 s with at least forty actors: the page has less than 3 MB; times are those of drawing at 200 instants."""
    library = Path(__file__).parents[3] / "xosc"
    text = (library / "coop" / "scenario_5.xosc").read_text(encoding="utf-8").replace("../", f"{library}/")
    text = text.replace('semiMajorAxis="95" semiMinorAxis="8"', 'semiMajorAxis="200" semiMinorAxis="200"')
    (tmp_path / "crowd.xosc").write_text(text, encoding="utf-8")
    arguments = ("--param", "Traffic=70", "--time-limit", "20", "--out", f"{tmp_path}/runs")
    done = eidrive("run", f"{tmp_path}/crowd.xosc", *arguments)
    (recording,) = (tmp_path / "runs").glob("*/recording.mcap")
    frames = list(read_recording(recording).frames())
    assert frames[-1].view.time == pytest.approx(20.0), done.output
    assert max(len(frame.view.names) for frame in frames) >= 40
    done = eidrive("view", recording, "--out", tmp_path / "crowd.html")
    assert done.exit_code == 0, done.output
    size = (tmp_path / "crowd.html").stat().st_size
    page = Page(browser, tmp_path / "crowd.html", 1440)
    times = page.page.evaluate(SCRUB)
    page.close("replay-of-forty-actors")
    assert len(times) == 200
    found = {"bytes": size, "median_ms": round(times[100], 1), "longest_of_20_ms": round(times[190], 1)}
    with capsys.disabled():
        sys.stdout.write(f"\nreplay of forty actors: {found}\n")
    for name, value in found.items():
        record_property(name, value)
    assert size < 3_000_000


def test_report_links_to_replay_of_a_run(browser: Any, report: Path) -> None:
    page = Page(browser, report, 1440)
    page.page.get_by_role("link", name="replay").first.click()
    page.page.wait_for_function("typeof shown !== 'undefined'")
    assert "/replays/" in page.page.url
    page.close("replay-from-report")


@pytest.mark.parametrize("size", WIDTHS)
def test_long_name_of_station_leaves_width_and_values_of_replay(
    browser: Any, eidrive: Eidrive, tmp_path: Path, size: str
) -> None:
    source = resolve_scenario("coop/scenario_1")
    text = source.read_text(encoding="utf-8").replace('"../', f'"{source.parent.parent}/')
    name = 200 * "E"
    path = tmp_path / "long.xosc"
    path.write_text(text.replace('"Ego"', f'"{name}"').replace("of: Ego", f"of: {name}"), encoding="utf-8")
    assert eidrive("run", path, "--channel", "ideal", "--out", tmp_path / "run").exit_code == 0
    assert eidrive("view", tmp_path / "run", "--out", tmp_path / "long.html").exit_code == 0
    page = Page(browser, tmp_path / "long.html", WIDTHS[size])
    assert not page.wide()
    widths = page.page.evaluate("[...document.querySelectorAll('.side dd')].map((value) => value.clientWidth)")
    assert min(width for width in widths if width) > 90
    page.close(f"replay-long-name-{size}")


LONG = "über_" + 120 * "x"
ATTACK = "</script><img src=x onerror=alert(1)>"


def reported_run(seed: int, *, passed: bool, scenario: str = "street", reason: str = "") -> dict[str, Any]:
    gap = {"name": "gap", "passed": passed, "value": 0.001 * seed, "limit": 2.0, "unit": "m", "reason": reason}
    return {
        "scenario": scenario,
        "seed": seed,
        "channel": "ideal" if seed % 2 else "lossy",
        "passed": passed,
        "end_reason": "stop trigger",
        "criteria": [gap, {"name": "speed", "passed": True}],
        "metrics": {"gap.Ego.center": 0.001 * seed, "gap.Ego.box": 0.0005 * seed},
        "settings": {"stations": {"Ego": {"detector": "oracle", "range": 50 + seed % 3}}},
        "settings_sha256": f"{seed:064}",
        "trace_hash": f"{seed}",
        "simulated_s": 10.0,
        "command": f"eidrive run {scenario} --seed {seed}",
    }


class ReportPage(Page):
    """Page of a report and what its table shows."""

    def seeds(self) -> list[int]:
        """Return the seeds of the rows that exist."""
        cells = self.page.locator("#table tbody[class] > tr:first-child > td[data-title=seed]").all_inner_texts()
        return [int(text.split()[-1]) for text in cells]

    def count(self) -> int:
        """Return the number of runs that the filters show."""
        assert self.page.inner_text("#shown").split()[0] == str(self.rows() - 1)
        return self.rows() - 1

    def rows(self) -> int:
        return int(self.page.get_attribute("#table", "aria-rowcount"))


@pytest.fixture
def runs_page(browser: Any, tmp_path: Path) -> Iterator[ReportPage]:
    """Report of 60 runs: seeds 7, 14, … failed."""
    runs = [
        reported_run(
            seed,
            passed=seed % 7 > 0,
            scenario="bridge" if seed > 50 else "street",
            reason=f"Ego came as near as {seed} mm" if seed % 7 == 0 else "",
        )
        for seed in range(1, 61)
    ]
    page = ReportPage(browser, write_run_report(runs, tmp_path), 1440)
    yield page
    page.close("report-used", full=False)


def test_report_shows_failed_runs_first_with_their_reasons(runs_page: ReportPage) -> None:
    assert runs_page.page.inner_text("h1") == "8 of 60 runs failed: gap (8)"
    assert runs_page.count() == 60
    first = runs_page.page.locator("#table tbody[class]").first
    assert first.locator("td.reason").inner_text() == "gap Ego came as near as 56 mm"
    assert set(runs_page.seeds()[:8]) == {7, 14, 21, 28, 35, 42, 49, 56}


def test_report_is_filtered_by_outcome_scenario_criterion_and_words(runs_page: ReportPage) -> None:
    page = runs_page.page
    page.get_by_role("button", name="failed 8").click()
    assert sorted(runs_page.seeds()) == [7, 14, 21, 28, 35, 42, 49, 56]
    page.select_option("#scenario", "bridge")
    assert (runs_page.seeds(), runs_page.count()) == ([56], 1)
    page.get_by_role("button", name="Show all runs").click()
    page.select_option("#criterion", "gap")
    assert runs_page.count() == 8
    for words, seeds in (
        ("as NEAR 42", [42]),
        ("--seed 33", []),
        ("speed lossy bridge", [56]),
        ("speed lossy 28", [28]),
    ):
        page.fill("#search", words)
        assert runs_page.seeds() == seeds, words
    page.select_option("#criterion", "")
    page.fill("#search", "run street --seed 33")
    assert runs_page.seeds() == [33]
    page.fill("#search", "52")
    assert all(seed == 52 or seed % 3 == 2 for seed in runs_page.seeds())
    assert runs_page.count() == 21
    page.fill("#search", "nobody")
    assert (runs_page.seeds(), runs_page.count()) == ([], 0)


def test_report_is_sorted_by_a_click_on_a_title(runs_page: ReportPage) -> None:
    page = runs_page.page
    head = page.get_by_role("columnheader", name="seed")
    head.get_by_role("button").click()
    assert runs_page.seeds()[:4] == [1, 2, 3, 4]
    assert head.get_attribute("aria-sort") == "ascending"
    head.get_by_role("button").press("Enter")
    assert runs_page.seeds()[:4] == [60, 59, 58, 57]
    assert head.get_attribute("aria-sort") == "descending"
    assert page.locator("th[aria-sort]").count() == 1
    assert head.get_by_role("button").evaluate("node => node === document.activeElement")


def test_row_of_report_opens_by_keyboard_with_criteria_metrics_settings_and_command(runs_page: ReportPage) -> None:
    page = runs_page.page
    page.fill("#search", "came 14")
    button = page.locator("#table .open")
    button.focus()
    page.keyboard.press("Enter")
    assert button.get_attribute("aria-expanded") == "true"
    details = page.locator("#table .details").inner_text()
    assert "gap failed 0.01 m, limit 2.00 m" in details
    assert "Ego center 0.014 m · Ego box 0.007 m" in details
    assert "speed passed" in details
    assert "eidrive run street --seed 14" in details
    page.get_by_text("Settings (2)").click()
    page.locator("#table .details dt", has_text="stations.Ego.range").wait_for()
    assert "stations.Ego.range\n52" in page.locator("#table .details").inner_text()
    page.keyboard.press("Shift+Tab")
    button.press("Space")
    assert page.locator("#table .details").count() == 0


def test_columns_and_filters_of_report_are_in_its_address(browser: Any, runs_page: ReportPage) -> None:
    page = runs_page.page
    page.locator("#columns summary").click()
    page.get_by_role("checkbox", name="gap Ego center [m]").check()
    page.get_by_role("checkbox", name="reason").uncheck()
    page.locator("#columns summary").click()
    page.fill("#search", "lossy")
    page.get_by_role("columnheader", name="gap Ego center [m]").get_by_role("button").click()
    titles = page.get_by_role("columnheader").all_inner_texts()
    assert "gap Ego center [m]" in titles
    assert "reason" not in titles
    assert runs_page.seeds()[:3] == [2, 4, 6]
    address = page.url
    page.goto("about:blank")
    page.goto(address)
    assert page.get_by_role("columnheader").all_inner_texts() == titles
    assert (runs_page.seeds()[:3], runs_page.count()) == ([2, 4, 6], 30)
    page.locator(".overview a").first.click()
    page.locator("#shown", has_text="with the settings").wait_for()  # the event of the new address comes later
    assert runs_page.count() < 30


def test_empty_group_in_address_of_report_filters_nothing(browser: Any, tmp_path: Path) -> None:
    runs = [reported_run(seed, passed=True) for seed in range(1, 7)]
    page = ReportPage(browser, write_run_report(runs, tmp_path), 1440, address="#group=")
    assert page.count() == 6
    page.close("report-group", full=False)


def test_metrics_belong_to_the_longest_name_of_a_criterion(browser: Any, tmp_path: Path) -> None:
    run = reported_run(1, passed=False)
    run["criteria"] = [
        {"name": "gap", "passed": False, "unit": "m"},
        {"name": "gap v1.5", "passed": True, "unit": "s"},
    ]
    run["metrics"] = {"gap.Ego.center": 4.0, "gap v1.5.Ego.center": 3.0}
    page = ReportPage(browser, write_run_report([run], tmp_path), 1440)
    items = page.page.locator("#table .details .checks li")
    assert items.locator(".setting").all_inner_texts() == ["Ego center 4 m", "Ego center 3 s"]
    page.close("report-criteria", full=False)


def test_long_column_title_of_report_breaks_between_its_parts(runs_page: ReportPage) -> None:
    page = runs_page.page
    page.locator("#columns summary").click()
    page.get_by_role("checkbox", name="stations.Ego.range").check()
    lines = """([...parts]) => parts.filter((part) => part.nodeType === Node.TEXT_NODE).map((part) => {
        const range = document.createRange();
        range.selectNode(part);
        return new Set([...range.getClientRects()].map(({ top }) => top)).size;
    })"""
    button = page.get_by_role("columnheader", name="stations.Ego.range").get_by_role("button")
    assert button.evaluate(f"(node) => ({lines})(node.childNodes)") == [1, 1, 1]


@pytest.mark.parametrize("size", WIDTHS)
def test_report_of_ten_thousand_runs_has_few_rows_and_reaches_all(browser: Any, tmp_path: Path, size: str) -> None:
    """Heights of rows differ; scrolling to the end and back neither skips nor repeats a run."""
    runs = [
        reported_run(seed, passed=seed % 10 > 0, reason=(seed % 9 + 1) * "word " if seed % 10 == 0 else "")
        for seed in range(1, 10_001)
    ]
    page = ReportPage(browser, write_run_report(runs, tmp_path), WIDTHS[size])
    assert page.count() == 10_000
    assert not page.wide()
    assert page.page.locator("#table tbody").count() < 100
    page.page.evaluate("sortBy(columns.find(({ title }) => title === 'seed'))")
    seen: list[int] = []
    for _ in range(40):
        seen = sorted({*seen, *page.seeds()})
        page.page.evaluate("rowBox.scrollTop += 400; showRows()")
    assert seen == list(range(1, len(seen) + 1))
    assert len(seen) > 150
    for _ in range(5):
        page.page.evaluate("rowBox.scrollTop = 1e9; showRows()")
    assert page.seeds()[-1] == 10_000
    page.page.fill("#search", "7777")
    assert page.seeds() == [7777]
    assert page.page.locator("#table tbody[class] tr").first.get_attribute("aria-rowindex") == "2"
    page.close(f"report-of-many-{size}", full=False)


@pytest.mark.parametrize("size", WIDTHS)
def test_unusual_names_in_report_are_texts(browser: Any, tmp_path: Path, size: str) -> None:
    runs = [
        reported_run(seed, passed=seed > 2, scenario=name) for seed, name in enumerate((LONG, ATTACK, "__proto__"), 1)
    ]
    runs[0]["criteria"][0] |= {"name": LONG, "reason": LONG}
    runs[1] |= {"metrics": {"constructor": 1.0, ATTACK: 2.0, LONG: 3.0}, "settings": {LONG: LONG, ATTACK: ATTACK}}
    runs[2] |= {"criteria": [], "passed": False, "metrics": {}, "settings": {}, "command": ""}
    page = ReportPage(browser, write_run_report(runs, tmp_path), WIDTHS[size])
    assert page.count() == 3
    for button in page.page.locator("#table .open").all():
        button.click()
    for summary in page.page.locator("#table .details summary").all():
        summary.click()
        summary.locator("+ dl").wait_for()
    assert ATTACK in page.page.locator("#table").inner_text()
    assert page.page.locator("img").count() == 0
    assert not page.wide()
    page.page.select_option("#scenario", ATTACK)
    assert page.seeds() == [2]
    page.close(f"report-names-{size}")


def test_report_without_script_lists_failures(browser: Any, tmp_path: Path) -> None:
    file = write_run_report([reported_run(seed, passed=seed > 1, reason="too near") for seed in (1, 2)], tmp_path)
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(file.as_uri())
    assert page.locator("noscript .failures tbody .reason").all_inner_texts() == ["gap too near"]
    assert not page.locator("#runs").is_visible()
    context.close()


DATA = """(() => {
  const sorted = (value) => Array.isArray(value) ? value.map(sorted)
    : value === null || typeof value !== "object" ? value
    : Object.fromEntries(Object.keys(value).sort().map((key) => [key, sorted(value[key])]));
  return JSON.stringify(sorted({ ...data, images: null }));
})()"""


class Gate:
    """Observer at which a run waits at a tick until it is opened."""

    def __init__(self, tick: int) -> None:
        self._tick = tick
        self.opened = threading.Event()

    def observe(self, frame: Frame) -> None:
        if frame.view.tick == self._tick:
            assert self.opened.wait(120.0)

    def close(self) -> None:
        pass


@pytest.mark.timeout(300)
def test_live_view_fills_and_becomes_the_replay(browser: Any, eidrive: Eidrive, tmp_path: Path) -> None:
    opened: list[str] = []
    first, second = Gate(40), Gate(100)
    with (
        LiveView(speed=math.inf, wait=0.0, browser=False, announce=opened.append) as live,
        ThreadPoolExecutor() as pool,
    ):
        run = pool.submit(run_and_save, "coop/scenario_1", out=tmp_path / "run", observers=[live, first, second])
        page = Page(browser, None, 1440, site=address_of(opened))
        page.wait("last === 40 && shown.time === 2")
        assert page.page.inner_text("#state") == "live"
        page.check("live-desktop")
        page.page.select_option("#view", "third")
        page.wait("space.state === 'ready' && space.actors.size === 4")
        assert colors(page) > 4000

        late = Page(browser, None, 390, site=live.address, dark=True)
        late.wait("last === 40")
        assert not late.wide()
        late.page.locator("#slider").fill("5")
        assert not late.page.is_checked("#at-end")
        late.page.evaluate("messageList.scrollTop = 700")
        first.opened.set()
        for each, instant in ((page, 5.0), (late, 0.25)):
            each.wait("last === 100 && grownTo === 100")
            each.wait(f"shown.time === {instant}")
        assert late.page.evaluate("[Number(element('slider').max), messageList.scrollTop]") == [100, 700]
        late.page.locator("h1").click()
        late.page.keyboard.press("End")
        assert late.page.is_checked("#at-end")
        late.check("live-phone", full=False)
        second.opened.set()

        assert run.result().passed
        replay = tmp_path / "replay.html"
        assert eidrive("view", tmp_path / "run", "--out", replay).exit_code == 0
        recorded = Page(browser, replay, 1440)
        for each in (page, late, Page(browser, None, 1440, site=live.address)):
            each.wait("!running && element('end-choice').hidden")
            assert each.page.evaluate(DATA) == recorded.page.evaluate(DATA)
            for part in ("badge", "verdict", "decisive"):
                assert each.page.inner_text(f"#{part}") == recorded.page.inner_text(f"#{part}")
            assert not each.faults
        late.close("live-end")


@pytest.mark.timeout(300)
def test_keys_before_the_first_frame_leave_a_live_view_at_the_end(browser: Any, tmp_path: Path) -> None:
    opened: list[str] = []
    first, last = Gate(0), Gate(8)
    with (
        LiveView(speed=math.inf, wait=0.0, browser=False, announce=opened.append) as live,
        ThreadPoolExecutor() as pool,
    ):
        run = pool.submit(run_and_save, "coop/scenario_1", out=tmp_path / "run", observers=[first, live, last])
        page = Page(browser, None, 1440, site=address_of(opened))
        for key in (" ", "ArrowRight", "Home", "End"):
            page.page.keyboard.press(key)
        first.opened.set()
        page.wait("last === 8 && shown.time === 0.4")
        last.opened.set()
        assert run.result().passed
        page.close("live-keys", full=False)


@pytest.mark.timeout(300)
def test_names_of_javascript_are_usual_names_in_replay_report_and_live_view(
    browser: Any, eidrive: Eidrive, tmp_path: Path
) -> None:
    """Objects of JavaScript inherit `constructor` and `toString`, and `__proto__` sets what they inherit from."""
    source = resolve_scenario("coop/scenario_1")
    text = source.read_text(encoding="utf-8").replace('"../', f'"{source.parent.parent}/')
    for name, other in (("Ego", "__proto__"), ("Incoming", "constructor"), ("RSU", "toString")):
        text = text.replace(f'"{name}"', f'"{other}"').replace(f"of: {name}", f"of: {other}")
        text = text.replace(f"to: {name}", f"to: {other}")
    path = tmp_path / "names.xosc"
    path.write_text(text, encoding="utf-8")
    opened: list[str] = []
    with LiveView(speed=math.inf, wait=0.0, browser=False, announce=opened.append) as live:
        assert run_and_save(path, out=tmp_path / "runs" / "one", observers=[live]).passed
        pages = [Page(browser, None, 1440, site=live.address)]
        pages[0].wait("!running && last > 0")
        report = eidrive("report", tmp_path / "runs", "--out", tmp_path / "report.html")
        assert report.exit_code == 0, report.output
        pages += [Page(browser, file, 1440) for file in (tmp_path / "replays").glob("*.html")]
        for page in pages:
            assert page.page.evaluate("[names.slice().sort(), stations.slice().sort()]") == [
                ["Firetruck", "__proto__", "constructor", "toString"],
                ["__proto__", "toString"],
            ]
            for station in ("toString", "", "__proto__"):
                page.page.select_option("#station", station)
            assert page.page.evaluate("poseOf('constructor').length") == 4
            assert "from toString" in page.page.inner_text("#known")
            page.close("names", full=False)
        assert len(pages) == 2
    Page(browser, tmp_path / "report.html", 1440).close("names-report")


def address_of(opened: list[str]) -> str:
    end = time.monotonic() + 60.0
    while not opened:
        assert time.monotonic() < end
        time.sleep(0.02)
    return opened[0]
