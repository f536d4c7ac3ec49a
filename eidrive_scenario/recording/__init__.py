"""Frames, trace hashes, recordings and text output of runs."""

from typing import TYPE_CHECKING

from eidrive_scenario.base.imports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.recording.camera_images import CameraImageWriter
    from eidrive_scenario.recording.frame import Frame
    from eidrive_scenario.recording.recorder import Recorder
    from eidrive_scenario.recording.recording import Recording, read_recording
    from eidrive_scenario.recording.text.csv_writer import CsvWriter
    from eidrive_scenario.recording.text.explanation import Explanation
    from eidrive_scenario.recording.text.run_log import RunLog
    from eidrive_scenario.recording.trace_hash import TraceHash
else:
    __getattr__ = lazy_exports(
        __name__,
        {
            "camera_images": "CameraImageWriter",
            "frame": "Frame",
            "recorder": "Recorder",
            "recording": "Recording read_recording",
            "text.csv_writer": "CsvWriter",
            "text.explanation": "Explanation",
            "text.run_log": "RunLog",
            "trace_hash": "TraceHash",
        },
    )

__all__ = [
    "CameraImageWriter",
    "CsvWriter",
    "Explanation",
    "Frame",
    "Recorder",
    "Recording",
    "RunLog",
    "TraceHash",
    "read_recording",
]
