"""Trace hash: equal for equal runs, different for every difference."""

import dataclasses
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.world.view import Contact

MakeFrame = Callable[..., Frame]


def fingerprint(*frames: Frame) -> str:
    trace = TraceHash()
    for frame in frames:
        trace.observe(frame)
    return trace.hexdigest()


def of_view(frame: Frame, **changes: Any) -> Frame:
    return replace(frame, view=replace(frame.view, **changes))


def nudged(array: Any) -> Any:
    """Return the array with its last number increased by one unit in the last place."""
    other = array.copy()
    other.flat[-1] = np.nextafter(other.flat[-1], np.inf)
    return other


def test_trace_hash_of_equal_frames_is_equal(make_frame: MakeFrame) -> None:
    assert fingerprint(make_frame(1), make_frame(2)) == fingerprint(make_frame(1), make_frame(2))
    assert fingerprint(make_frame(1), make_frame(2)) != fingerprint(make_frame(2), make_frame(1))


@pytest.mark.parametrize("field", ["position", "yaw", "pitch", "roll", "velocity"])
def test_trace_hash_depends_on_last_bit_of_motion(make_frame: MakeFrame, field: str) -> None:
    frame = make_frame(1)
    assert fingerprint(of_view(frame, **{field: nudged(getattr(frame.view, field))})) != fingerprint(frame)


def test_trace_hash_depends_on_names_contacts_changes_and_messages(make_frame: MakeFrame) -> None:
    frame = make_frame(1)
    others = [
        of_view(frame, names=("Ego", "IncomingL", "öschzug")),
        of_view(frame, contacts=()),
        of_view(frame, contacts=(Contact("Ego", "Incoming", (1.0, 2.0, 0.3), 11.5),)),
        replace(frame, changes=()),
        replace(frame, links=frame.links[:1]),
        replace(frame, links=(replace(frame.links[0], arrives=0.36), frame.links[1])),
    ]
    assert len({fingerprint(frame), *map(fingerprint, others)}) == 1 + len(others)


def test_trace_hash_does_not_depend_on_reason_text(make_frame: MakeFrame) -> None:
    frame = make_frame(1)
    reworded = replace(frame, changes=(dataclasses.replace(frame.changes[0], why="time above 3 s"),))
    assert fingerprint(reworded) == fingerprint(frame)


def test_trace_hash_is_equal_in_other_processes() -> None:
    script = (
        "import numpy as np; from eidrive_scenario.recording.trace_hash import TraceHash\n"
        "from eidrive_scenario.recording.frame import Frame; from eidrive_scenario.world.view import WorldView\n"
        "one, three = np.ones(1), np.ones((1, 3))\n"
        "view = WorldView(0.05, 1, ('Ego',), ('car',), three, one, one, one, three, three, one, one, three, three)\n"
        "trace = TraceHash(); trace.observe(Frame(view)); print(trace.hexdigest())"
    )
    outputs = {
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    }
    assert len(outputs) == 1
    assert len(outputs.pop().strip()) == 64
