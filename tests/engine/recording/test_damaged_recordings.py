"""Damaged recordings: reported within bounds of time and memory, without an internal error.

The environment variable EIDRIVE_MUTANTS sets the number of damaged recordings (default 32).
"""

from __future__ import annotations

import os
import re
import resource
import zlib
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from processor_time import within_readings
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.recording import mcap_records
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings

from .mutants import ATTACHMENT, CHUNK, MUTATIONS, join, messages, mutant, pack, split, unpack

COUNT = int(os.environ.get("EIDRIVE_MUTANTS", "32"))
PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"
RUNS: list[tuple[str | Path, dict[str, Any]]] = [
    ("coop/scenario_1", {"time_limit": 6.0}),
    ("coop/scenario_2", {"channel": "none", "time_limit": 5.0}),
    ("coop/scenario_1_late_rsu", {"channel": "{loss: {kind: bernoulli, probability: 0.3}}", "time_limit": 5.0}),
    ("coop/scenario_2", {"channel": "congested", "dt": 0.1, "weather": "storm", "time_limit": 6.0}),
    (PASSING_BY, {"dt": 0.005}),
]
MAX_BYTES = 2 * 2**30


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Record several runs of the library."""
    found = []
    for source, settings in RUNS[: max(2, min(len(RUNS), COUNT // 10))]:
        result = run_and_save(source, settings=RunSettings(**settings), below=tmp_path_factory.mktemp("runs"))
        assert result.recording is not None
        found.append(result.recording)
    return found


Content = tuple[dict[str, str], dict[str, bytes], list[Any]]


def content(path: Path) -> tuple[Content, tuple[str, ...]]:
    """Return the whole content of a recording, and its damage."""
    encode = codec(Frame).encode
    recording = read_recording(path)
    frames = [encode(frame) for frame in recording.frames()]
    return (dict(recording.metadata), dict(recording.attachments), frames), recording.damage


@cache
def original_content(path: Path) -> Content:
    found, damage = content(path)
    assert damage == ()
    return found


def view(path: Path) -> tuple[int, str, str]:
    """Return exit code, standard error and page of `eidrive view`."""
    page = path.with_suffix(".html")
    page.unlink(missing_ok=True)
    result = CliRunner().invoke(app, ["view", str(path), "--out", str(page)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stderr, page.read_text(encoding="utf-8") if page.exists() else ""


def test_read_recording_of_undamaged_file_reports_no_damage(originals: list[Path]) -> None:
    for path in originals:
        chunks = [body for opcode, body in split(path.read_bytes()) if opcode == CHUNK]
        assert len(chunks) >= 2, path
        assert read_recording(path).damage == ()
        code, error, page = view(path)
        assert (code, error) == (0, "")
        assert "This recording is damaged" not in page


@pytest.mark.exhaustive
@pytest.mark.timeout(0 if COUNT > 100 else 600)
def test_view_of_damaged_recordings_reports_the_damage(originals: list[Path], tmp_path: Path) -> None:
    outcomes: Counter[str] = Counter()
    path = tmp_path / "damaged.mcap"
    for number in range(COUNT):
        source = originals[number % len(originals)]
        kind, data = mutant(source.read_bytes(), number)
        path.write_bytes(data)
        try:
            found, damage = within_readings(100, lambda: content(path))
        except InputError:
            found, damage = None, ("refused",)
        code, error, page = within_readings(100, lambda: view(path))
        case = f"mutant {number} ({kind} of {source.parent.name})"
        assert "internal error" not in error, case
        assert code in (0, 2), f"{case}: {error}"
        assert (code == 0) == bool(page), case
        if not damage:
            assert found == original_content(source), f"{case} is shown as undamaged"
        shown_whole = code == 0 and f"warning: {path}:" not in error
        assert shown_whole == (not damage), f"{case}: {error}"
        assert ("This recording is damaged" in page) == (code == 0 and bool(damage)), case
        outcomes["refused" if code == 2 else "intact" if shown_whole else "shown with its damage"] += 1
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(f"{COUNT} damaged recordings: {dict(outcomes)}; peak {peak / 2**20:.0f} MiB")  # noqa: T201
    assert outcomes["shown with its damage"] >= COUNT // 2
    assert peak < MAX_BYTES


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("cut", "missing"),
        ("append", "the file does not end with its last record"),
        ("drop chunk", "recorded frames are present"),
        ("swap chunks", "out of order"),
        ("double chunk", "duplicated or out of order"),
        ("edit frame", "differ from the recorded ones"),
        ("edit attachment", "differ from the recorded ones"),
        ("bomb", "checksum"),
    ],
)
def test_damage_of_each_kind_is_described(originals: list[Path], tmp_path: Path, kind: str, message: str) -> None:
    import random

    data = MUTATIONS[kind](originals[0].read_bytes(), random.Random(5))
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    assert message in " / ".join(read_recording(path).damage)


def test_missing_ticks_are_listed(originals: list[Path], tmp_path: Path) -> None:
    records = split(originals[0].read_bytes())
    chunks = [place for place, (opcode, _) in enumerate(records) if opcode == CHUNK]
    ticks = [
        int.from_bytes(body[2:6], "little") for opcode, body in messages(unpack(records[chunks[1]][1])) if opcode == 5
    ]
    del records[chunks[1]]
    path = tmp_path / "gap.mcap"
    path.write_bytes(join(records))
    recording = read_recording(path)
    assert f"ticks are missing: {ticks[0]} to {ticks[-1]}" in recording.damage
    shown = [frame.view.tick for frame in recording.frames()]
    assert len(shown) == recording.frame_count
    assert not set(shown) & set(ticks)


def test_chunks_after_damaged_length_field_are_read(originals: list[Path], tmp_path: Path) -> None:
    data = originals[0].read_bytes()
    records = split(data)
    first = next(place for place, (opcode, _) in enumerate(records) if opcode == CHUNK)
    offset = 8 + sum(9 + len(body) for _, body in records[:first])
    path = tmp_path / "lost.mcap"
    path.write_bytes(data[: offset + 40] + b"???" + data[offset + 40 :])
    recording = read_recording(path)
    later = [frame.view.tick for frame in recording.frames()]
    assert later
    assert later[-1] == original_content(originals[0])[2][-1]["view"]["tick"]


def _forged(path: Path, source: Path, change: Callable[[bytes], bytes]) -> Path:
    """Write a recording with changed frames, a valid seal and valid checksums."""
    from mcap.writer import CompressionType, Writer

    from eidrive_scenario.recording.integrity import Seal

    records = split(source.read_bytes())
    recording = read_recording(source)
    seal = Seal()
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile="", library="other")
        writer.add_metadata("run", dict(recording.metadata))
        seal.add_metadata(recording.metadata)
        for name, data in recording.attachments.items():
            writer.add_attachment(0, 0, name, "application/octet-stream", data)
            seal.add_attachment(name, data)
        schema = writer.register_schema("eidrive.Frame", "jsonschema", b"{}")
        channel = writer.register_channel("/frame", "json", schema)
        for opcode, body in records:
            for inner, message in messages(unpack(body)) if opcode == CHUNK else ():
                if inner == 5:
                    tick, text = int.from_bytes(message[2:6], "little"), change(message[22:])
                    writer.add_message(channel, tick, text, tick, sequence=tick)
                    seal.add_frame(tick, tick, text)
        writer.flush()  # type: ignore[no-untyped-call]
        writer.add_metadata("end", seal.entries())
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.exhaustive
@pytest.mark.parametrize("number", range(11))
def test_view_of_forged_recording_raises_no_internal_error(originals: list[Path], tmp_path: Path, number: int) -> None:
    import random

    from .mutants import EDITS

    draw = random.Random(number)
    path = _forged(tmp_path / "forged.mcap", originals[1], lambda text: EDITS[number](text, draw))
    code, error, _ = view(path)
    assert code in (0, 2), error
    assert "internal error" not in error


@pytest.mark.exhaustive
@pytest.mark.parametrize("number", range(11))
def test_picture_of_forged_recording_raises_no_internal_error(
    originals: list[Path], tmp_path: Path, number: int
) -> None:
    import random

    from .mutants import EDITS

    draw = random.Random(number)
    path = _forged(tmp_path / "forged.mcap", originals[1], lambda text: EDITS[number](text, draw))
    done = CliRunner().invoke(app, ["view", str(path), "--png", str(tmp_path / "a.png")])
    assert done.exit_code in (0, 2), done.stderr
    assert "internal error" not in done.stderr


def test_view_of_recording_escapes_actor_names(originals: list[Path], tmp_path: Path) -> None:
    attack = b"</script><img src=x onerror=alert(1)>"
    path = _forged(tmp_path / "forged.mcap", originals[1], lambda text: text.replace(b'"Ego"', b'"' + attack + b'"'))
    code, _, page = view(path)
    assert code == 0
    assert attack.decode() not in page
    assert "<img src" not in page


def test_read_recording_of_irregular_file_raises_input_error(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    for path in (tmp_path / "pipe.mcap", Path("/dev/zero")):
        with pytest.raises(InputError, match="not a regular file"):
            read_recording(path)


def test_view_of_many_decompression_bombs_is_bounded_in_memory(originals: list[Path], tmp_path: Path) -> None:
    """The recording has 20 chunks of 64 MiB each."""
    records = split(originals[1].read_bytes())
    place = next(place for place, (opcode, _) in enumerate(records) if opcode == CHUNK)
    bomb = (CHUNK, pack(records[place][1], b"\x05" + (2**26).to_bytes(8, "little") + bytes(2**26)))
    path = tmp_path / "bombs.mcap"
    path.write_bytes(join([*records[:place], *[bomb] * 20, *records[place:]]))
    code, error, _ = view(path)
    assert code in (0, 2)
    assert "internal error" not in error
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 < MAX_BYTES


def test_read_recording_counts_messages_of_all_channels(originals: list[Path], tmp_path: Path) -> None:
    """Each of 40 chunks has 130,000 empty messages of channel 9, in less than 1 kB."""
    records = split(originals[1].read_bytes())
    place = next(place for place, (opcode, _) in enumerate(records) if opcode == CHUNK)
    message = b"\x05" + (22).to_bytes(8, "little") + (9).to_bytes(2, "little") + bytes(20)
    many = (CHUNK, pack(records[place][1], message * 130_000))
    assert len(many[1]) < 1000
    path = tmp_path / "messages.mcap"
    path.write_bytes(join([*records[:place], *[many] * 40, *records[place:]]))
    recording = within_readings(2.0, lambda: read_recording(path))
    assert any("maximum number or size of frames and messages" in line for line in recording.damage)


def test_read_recording_counts_uncompressed_bytes_of_all_chunks(
    originals: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of 40 chunks has one message of 4 MB of channel 9; a file of this size may have 64 MiB."""
    read: list[int] = []
    decompress = mcap_records._decompress

    def counted(packed: bytes, size: int) -> bytes:
        read.append(size)
        return decompress(packed, size)

    monkeypatch.setattr(mcap_records, "_decompress", counted)
    records = split(originals[1].read_bytes())
    place = next(place for place, (opcode, _) in enumerate(records) if opcode == CHUNK)
    message = b"\x05" + (4_000_000).to_bytes(8, "little") + (9).to_bytes(2, "little") + bytes(3_999_998)
    path = tmp_path / "large.mcap"
    path.write_bytes(join([*records[:place], *[(CHUNK, pack(records[place][1], message))] * 40, *records[place:]]))
    recording = read_recording(path)
    assert any("maximum number or size of frames and messages" in line for line in recording.damage)
    assert len(read) == 2**26 // 4_000_009
    assert not recording.frame_count


@pytest.mark.parametrize(
    ("field", "value"), [("time", b"1e308"), ("time", b"-1.0"), ("tick", b"9223372036854775808"), ("tick", b"-1")]
)
def test_frame_with_time_or_tick_out_of_range_is_refused(
    originals: list[Path], tmp_path: Path, field: str, value: bytes
) -> None:
    """The seal of the forged recording is valid, and the view is the first entry of each frame."""
    name = field.encode()
    path = _forged(
        tmp_path / "forged.mcap",
        originals[1],
        lambda text: re.sub(rb'"%b":[^,]+' % name, b'"%b":%b' % (name, value), text, count=1),
    )
    for options in (["--mcap", "a.mcap"], ["--osi", "a.osi.mcap"], ["--foxglove", "a.fg.mcap"], ["--csv", "a.csv"]):
        done = CliRunner().invoke(app, ["export", str(path), options[0], str(tmp_path / options[1])])
        assert (done.exit_code, type(done.exception)) == (2, SystemExit), options
        assert f"{field} is out of range" in done.stderr


def test_view_of_huge_road_network_omits_roads(originals: list[Path], tmp_path: Path) -> None:
    roads = (road_xml(str(number), length=1e6, y=float(number), lanes=lanes_xml(0, 1, 3)) for number in range(200))
    huge = map_xml(*roads).encode()
    path = tmp_path / "huge.mcap"
    path.write_bytes(_with_road(originals[1].read_bytes(), huge))
    code, error, page = within_readings(200, lambda: view(path))
    assert (code, bool(page)) == (0, True)
    assert "roads are not drawn: " in error


def _with_road(data: bytes, road: bytes) -> bytes:
    records = split(data)
    for place, (opcode, body) in enumerate(records):
        if opcode == ATTACHMENT and b"road.xodr" in body[:60]:
            start = body.index(b"octet-stream") + len(b"octet-stream")
            content = body[:start] + len(road).to_bytes(8, "little") + road
            records[place] = (ATTACHMENT, content + zlib.crc32(content).to_bytes(4, "little"))
    return join(records)
