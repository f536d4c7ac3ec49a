"""Pictures and films of a recorded run: the top view that follows a station, as PNG, SVG, PDF, GIF or MP4."""

from __future__ import annotations

import math
import shutil
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from subprocess import PIPE, Popen
from tempfile import TemporaryDirectory

from matplotlib.figure import Figure

from eidrive_scenario.base.installation import install_command
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.errors import Diagnostic, InputError, SettingError
from eidrive_scenario.experiments.reported_run import ReportedRun
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.recording.recording import Recording
from eidrive_scenario.reporting.drawing.image_canvas import Image
from eidrive_scenario.reporting.drawing.road_drawing import recorded_network
from eidrive_scenario.reporting.drawing.snapshot_picture import EXTENT, draw_snapshot, snapshot_picture
from eidrive_scenario.reporting.drawing.top_view import Window
from eidrive_scenario.reporting.drawing.vector_canvas import DEFAULT_SIZE, Size, scene_figure
from eidrive_scenario.reporting.replay.frame_data import UNDRAWABLE, describe_error
from eidrive_scenario.reporting.replay.page import decisive_instant, drawn_roads, run_settings, station_settings
from eidrive_scenario.reporting.replay.series import SeriesBuilder
from eidrive_scenario.reporting.run_report.settings_text import shorten
from eidrive_scenario.reporting.snapshot import DEFAULT_SETTINGS, SnapshotBuilder, StationSnapshot

FILM_SIZE, GIF_SIZE = (1280, 720), (640, 360)
"""Width and height of films and GIF files [pixels]."""
FILM_RATE, GIF_RATE = 20.0, 10.0
"""Pictures per second of a film and of a GIF."""
MOST_PICTURES = 100_000
"""Maximum number of pictures of a film: 83 minutes of an MP4."""
_PALETTE = "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=none:diff_mode=rectangle"
"""Filter of FFmpeg that selects the 256 colors of a GIF by the pictures."""


class RecordedStation:
    """Snapshots of one station of a recording: `name`, or the first one that drives; else the first station.

    Without stations, the snapshots contain the ground truth, and the view follows the first actor. Raise InputError if
    the recording contains no readable frame, SettingError if it has no such station or actor.

    result  of the run, which determines the decisive instant
    """

    def __init__(self, recording: Recording, name: str | None = None, *, result: ReportedRun | None = None) -> None:
        report = DamageReport()
        for line in recording.damage:
            report.add(line)
        self._recording = recording
        self._settings = station_settings(run_settings(recording, report))
        self.roads = drawn_roads(partial(recorded_network, recording), report)
        series = SeriesBuilder()
        self.times: list[float] = []
        """Times of the frames [s]."""
        driven: dict[str, None] = {}
        stations: dict[str, None] = {}
        actors: dict[str, tuple[float, float]] = {}
        """Positions at which the actors enter the world [m]."""
        for frame in recording.frames(lambda reason: report.add("frames cannot be decoded", shorten(reason, 200))):
            if math.isfinite(frame.view.time):
                self.times.append(frame.view.time)
            for actor, (x, y, _) in zip(frame.view.names, frame.view.centers.tolist(), strict=True):
                actors.setdefault(actor, (x, y) if math.isfinite(x + y) else (0.0, 0.0))
            stations.update(dict.fromkeys(frame.steps))
            driven.update(dict.fromkeys(key for key, step in frame.steps.items() if step.control is not None))
            try:
                series.observe(frame)
            except UNDRAWABLE as error:
                report.add("frames cannot be drawn", f"tick {frame.view.tick}: {describe_error(error)}")
        if not self.times or not actors:
            reason = "; ".join(report.lines()) or "record the run again"
            raise InputError(Diagnostic("the recording shows no actor", reason, str(recording.path)))
        if name is not None and name not in actors:
            available = ", ".join([*stations, *(actor for actor in actors if actor not in stations)][:12])
            raise SettingError(Diagnostic(f"--station: the run has no actor {name!r}", f"known: {available}"))
        self.name = name or next(iter([*driven, *stations, *actors]))
        self._entry = actors.get(self.name, (0.0, 0.0))
        decisive = decisive_instant({"contact": series.contact, "decisive": series.decisive}, result, actors)
        instant = decisive["time"] if decisive is not None else self.times[0]
        self.decisive: float = min(max(instant, self.times[0]), self.times[-1])
        """Decisive instant [s]; at most that of the last frame of an incomplete recording."""
        self.damage = report.lines()

    def figure(self, time: float | None = None, size: Size = DEFAULT_SIZE) -> Figure:
        """Return the picture of the last frame up to a time [s], by default up to the decisive instant.

        size  width and height [mm]

        Raise SettingError for a time out of the run, InputError if the frame cannot be drawn.
        """
        first, last = self.times[0], self.times[-1]
        wanted = self.decisive if time is None else time
        if not first - TIME_TOLERANCE <= wanted <= last + TIME_TOLERANCE:
            raise SettingError(Diagnostic(f"--at {wanted:g} s is not in the run", f"give {first:g} to {last:g} s"))
        newest = None
        for snapshot, center in self._centered():
            if snapshot.time > wanted + TIME_TOLERANCE:
                break
            newest = snapshot, center
        if newest is not None:
            snapshot, center = newest
            with suppress(*UNDRAWABLE):
                return scene_figure(
                    lambda canvas: draw_snapshot(canvas, snapshot, self.roads),
                    lambda ratio: Window.centered(center, EXTENT, ratio),
                    size,
                )
        raise InputError(Diagnostic("this frame of the recording cannot be drawn", "give another --at"))

    def pictures(self, size: tuple[int, int], rate: float) -> Iterator[Image]:
        """Yield the pictures of `rate` instants per second, each of the last frame until then.

        Raise InputError for more than MOST_PICTURES.
        """
        shown = 0
        picture: Image | None = None
        for snapshot, center in self._centered():
            later = bisect_right(self.times, snapshot.time)
            if later < len(self.times):
                wanted = math.ceil((self.times[later] - self.times[0]) * rate - 1e-6)
            else:
                wanted = math.floor((snapshot.time - self.times[0]) * rate + 1e-6) + 1
            if wanted > MOST_PICTURES:
                hint = "write pictures with --png, or the page"
                raise InputError(Diagnostic(f"the film has more than {MOST_PICTURES} pictures", hint))
            if wanted > shown:
                try:
                    picture = snapshot_picture(snapshot, self.roads, center, size=size)
                except UNDRAWABLE:
                    if picture is None:
                        continue
                for _ in range(wanted - shown):
                    yield picture
                shown = wanted

    def _centered(self) -> Iterator[tuple[StationSnapshot, tuple[float, float]]]:
        """Yield the snapshots at finite times, with the last or else the first position of the station [m]."""
        center = self._entry
        builder = SnapshotBuilder(self.name, self._settings.get(self.name, DEFAULT_SETTINGS))
        for frame in self._recording.frames(lambda reason: None):
            try:
                snapshot = builder.observe(frame)
            except UNDRAWABLE:
                continue
            if not math.isfinite(snapshot.time):
                continue
            if self.name in snapshot.view:
                x, y = snapshot.view.centers[snapshot.view.row(self.name), :2].tolist()
                center = (x, y) if math.isfinite(x + y) else center
            yield snapshot, center


def write_gif(station: RecordedStation, path: Path) -> None:
    """Write the run as an animated GIF at its speed, GIF_RATE pictures per second. Raise SettingError."""
    _encode(station, path, GIF_SIZE, GIF_RATE, ["-c:v", "gif", "-filter_complex", _PALETTE, "-loop", "0"])


def write_mp4(station: RecordedStation, path: Path) -> None:
    """Write the run as a film at its speed, FILM_RATE pictures per second in H.264. Raise SettingError."""
    quality = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-preset", "veryfast", "-movflags", "+faststart"]
    _encode(station, path, FILM_SIZE, FILM_RATE, quality)


def _encode(station: RecordedStation, path: Path, size: tuple[int, int], rate: float, arguments: Sequence[str]) -> None:
    """Write the pictures by FFmpeg to a file with the suffix of `path`."""
    try:
        import imageio_ffmpeg
    except ImportError as error:
        hint = f"install it: {install_command('film')}"
        raise SettingError(Diagnostic("films require imageio-ffmpeg, which is not installed", hint)) from error
    source = ["-f", "rawvideo", "-pix_fmt", "bgr24", "-s", f"{size[0]}x{size[1]}", "-r", f"{rate:g}", "-i", "-"]
    with TemporaryDirectory() as folder:
        made = Path(folder) / f"film{path.suffix.lower() or '.mp4'}"
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-threads", "1", *source, *arguments, str(made)]
        with Popen(command, stdin=PIPE, stderr=PIPE) as encoder:
            assert encoder.stdin is not None
            assert encoder.stderr is not None
            with suppress(BrokenPipeError):
                for picture in station.pictures(size, rate):
                    encoder.stdin.write(picture.tobytes())
                encoder.stdin.close()
            message = encoder.stderr.read().decode(errors="replace").strip()
        if encoder.returncode or not made.is_file():
            raise SettingError(Diagnostic(f"FFmpeg cannot write the film: {message[:300]}", "", str(path)))
        with write_atomically(path) as stream, made.open("rb") as content:
            shutil.copyfileobj(content, stream)
