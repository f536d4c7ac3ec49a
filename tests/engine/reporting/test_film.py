"""Pictures and films of a recorded run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.experiments.reported_run import ReportedRun
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import open_recording
from eidrive_scenario.reporting.drawing.image_canvas import ImageCanvas
from eidrive_scenario.reporting.drawing.labels import label_places, overlaps, write_labels
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window
from eidrive_scenario.reporting.replay import film
from eidrive_scenario.reporting.replay.film import RecordedStation, write_gif, write_mp4
from eidrive_scenario.reporting.snapshot import SnapshotBuilder
from eidrive_scenario.simulation import RunSettings, Simulation

Play = Callable[..., list[Frame]]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small films, which are written faster."""
    monkeypatch.setattr(film, "FILM_SIZE", (160, 90))
    monkeypatch.setattr(film, "GIF_SIZE", (160, 90))


def recorded(frames: list[Frame], folder: Path) -> RecordedStation:
    recorder = Recorder(folder / "run.mcap", metadata={"scenario": "street", "seed": "1"})
    for frame in frames:
        recorder.observe(frame)
    recorder.close()
    return RecordedStation(open_recording(folder / "run.mcap"))


def test_station_is_the_first_that_drives(street: Play, tmp_path: Path) -> None:
    assert recorded(street(1), tmp_path).name == "Ego"


def test_unknown_station_is_refused_with_known_names(street: Play, tmp_path: Path) -> None:
    recorded(street(1)[:3], tmp_path)
    with pytest.raises(SettingError, match=r"no actor 'Bus'.*known: Ego, "):
        RecordedStation(open_recording(tmp_path / "run.mcap"), "Bus")


def test_recording_without_frames_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no actor"):
        recorded([], tmp_path)


def test_film_shows_station_in_its_middle(street: Play, tmp_path: Path) -> None:
    """The body of the station is dark, the ground is light."""
    picture = list(recorded(street(1), tmp_path).pictures(film.FILM_SIZE, film.FILM_RATE))[40]
    height, width = picture.shape[:2]
    assert (width, height) == film.FILM_SIZE
    assert picture[height // 2, width // 2].max() < 60
    assert picture[height // 2 + 150, width // 2].min() > 200


def test_picture_before_the_entry_of_the_station_shows_its_place(street: Play, tmp_path: Path) -> None:
    """The ego enters in frame 40; the world is 1000 m away from its origin."""
    frames = street(1)
    shifted = [replace(frame.view, position=np.add(frame.view.position, (1000.0, 0.0, 0.0))) for frame in frames]
    for tick, view in enumerate(shifted):
        late = frames[tick].steps if tick >= 40 else {}
        frames[tick] = replace(frames[tick], view=view if late else view.without(["Ego"]), steps=late)
    station = recorded(frames, tmp_path)
    entry = shifted[40].centers[shifted[40].row("Ego"), :2]
    assert station.name == "Ego"
    assert next(iter(station._centered()))[1] == pytest.approx(tuple(entry))


def test_speed_at_a_contact_is_that_of_the_impact() -> None:
    """In the frame of the contact the view has the speed after it."""
    builder, speeds = SnapshotBuilder("Ego"), [(0.0, 0.0)]
    with Simulation(resolve_scenario("coop/scenario_1"), settings=RunSettings(channel="none")) as simulation:
        while True:
            frame, end = simulation.tick()
            snapshot = builder.observe(frame)
            speeds.append((float(frame.view.speed[frame.view.row("Ego")]), snapshot.speeds["Ego"]))
            if frame.view.contacts or end is not None:
                break
    assert frame.view.contacts
    assert [view for view, _ in speeds[:-1]] == [shown for _, shown in speeds[:-1]]
    assert speeds[-1][0] < speeds[-1][1] == speeds[-2][0]


@pytest.mark.parametrize("time", [-1.0, 99.0])
def test_picture_outside_of_run_is_refused(street: Play, tmp_path: Path, time: float) -> None:
    with pytest.raises(SettingError, match="not in the run"):
        recorded(street(1), tmp_path).figure(time)


def test_picture_of_incomplete_recording_is_within_its_frames(street: Play, tmp_path: Path) -> None:
    """Ten frames of 0.05 s, beside a result whose smallest distance is at 4 s."""
    recorded(street(1)[:10], tmp_path)
    metrics: dict[str, float | None] = {"min_distance.Ego.Other.center": 2.0, "min_distance.Ego.Other.time": 4.0}
    result = ReportedRun(scenario="street", seed=1, passed=True, end_reason="stop trigger", metrics=metrics)
    station = RecordedStation(open_recording(tmp_path / "run.mcap"), result=result)
    assert station.decisive == pytest.approx(0.45)
    assert station.figure() is not None


def test_picture_shows_the_last_frame_until_its_instant(
    street: Play, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames are at multiples of 0.05 s, pictures at those of 1/12 s; 1/12 s is in the interval of the second frame."""
    monkeypatch.setattr(film, "snapshot_picture", lambda snapshot, *_, **__: snapshot.time)
    times = list(recorded(street(1), tmp_path).pictures(film.GIF_SIZE, 12.0))
    assert times == pytest.approx([0.05 * (20 * number // 12) for number in range(int(4.95 * 12) + 1)])


@pytest.mark.usefixtures("small")
def test_film_plays_at_the_speed_of_the_run(street: Play, tmp_path: Path) -> None:
    """100 frames of 0.05 s are 100 pictures at 20 per second, and 50 of a GIF at 10 per second."""
    pytest.importorskip("imageio_ffmpeg")
    station = recorded(street(1), tmp_path)
    write_mp4(station, tmp_path / "a.mp4")
    write_gif(station, tmp_path / "a.gif")
    for name, count, rate in (("a.mp4", 100, 20.0), ("a.gif", 50, 10.0)):
        video = cv2.VideoCapture(str(tmp_path / name))
        assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(rate)
        pictures = 0
        while video.read()[0]:
            pictures += 1
        assert pictures == count, name


def test_film_of_run_with_far_time_is_refused(street: Play, tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    frames = street(1)[:3]
    frames[2] = replace(frames[2], view=replace(frames[2].view, time=1e8))
    with pytest.raises(InputError, match="more than 100000 pictures"):
        write_gif(recorded(frames, tmp_path), tmp_path / "a.gif")
    assert not (tmp_path / "a.gif").exists()


def test_film_without_encoder_states_the_extra(street: Play, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(SettingError, match=r"\[film\]"):
        write_mp4(recorded(street(1)[:3], tmp_path), tmp_path / "a.mp4")


def test_canvas_fills_polygon_with_opacity() -> None:
    canvas = ImageCanvas(Window(-5.0, 5.0, -5.0, 5.0), (100, 100))
    before = canvas.image[50, 50].astype(float)
    canvas.fill(np.array([(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)]), "#000000", 0.25)
    assert canvas.image[50, 50] == pytest.approx(0.75 * before, abs=1.0)
    assert canvas.image[10, 10] == pytest.approx(before)


def test_canvas_draws_far_points_without_overflow() -> None:
    canvas = ImageCanvas(Window(-5.0, 5.0, -5.0, 5.0), (100, 100))
    canvas.roads(RoadDrawing(lanes=(("driving", np.array([(-1e9, -1.0), (1e9, -1.0), (1e9, 1.0), (-1e9, 1.0)])),)))
    assert (canvas.image[50] != canvas.image[5]).any(axis=1).all()


@pytest.mark.parametrize("place", [(30_000, 30_000), (-(10**6), 50), (50, -(10**9)), (50, 50)])
def test_canvas_writes_labels_at_any_place(place: tuple[int, int]) -> None:
    canvas = ImageCanvas(Window(-5.0, 5.0, -5.0, 5.0), (100, 100))
    before = canvas.image.copy()
    for text in ("name " * 1000, "\x00\n\ud800", "車\U0001f697é"):
        canvas.label(text, *place)
    assert (canvas.image != before).any() == (place == (50, 50))


@pytest.mark.parametrize(
    ("others", "side"),
    [
        ([], 0),
        ([(140, 100, 160, 120)], 1),
        ([(140, 100, 160, 120), (80, 100, 100, 120)], 2),
        ([(140, 100, 160, 120), (80, 100, 100, 120), (90, 90, 150, 95)], 3),
        ([(0, 0, 143, 300), (150, 0, 300, 300)], 0),
    ],
)
def test_place_of_label_has_least_overlap(others: list[tuple[float, ...]], side: int) -> None:
    """Right, left, above, below: the first place without an overlap, or that with the smallest."""
    places = label_places((50.0, 10.0), np.array([100.0, 100.0, 140.0, 120.0]))
    assert places.tolist() == [[146, 105, 196, 115], [44, 105, 94, 115], [95, 84, 145, 94], [95, 126, 145, 136]]
    assert int(np.argmin(overlaps(places, np.array(others).reshape(-1, 4)))) == side


def test_labels_of_a_crowd_do_not_cover_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 400 bodies in a grid of 1 m only some have labels; the first one has."""
    canvas = ImageCanvas(Window(0.0, 40.0, 0.0, 40.0), (400, 400))
    corners = np.array([(-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4)])
    outlines = [corners + np.array([10.0 + x, 10.0 + y]) for x in range(20) for y in range(20)]
    written: list[tuple[str, float, float]] = []
    monkeypatch.setattr(canvas, "label", lambda text, left, base, *_: written.append((text, left, base)))
    write_labels(canvas, [f"car {number}" for number in range(400)], outlines)
    rectangles = [
        (left, base - size[1], left + size[0], base)
        for text, left, base in written
        for size in [canvas.label_size(text)]
    ]
    assert written[0][0] == "car 0"
    assert 10 < len(written) < 200
    common = overlaps(np.array(rectangles), np.array(rectangles))
    area = [(right - left) * (bottom - top) for left, top, right, bottom in rectangles]
    assert (common <= 1.5 * np.array(area)).all()
