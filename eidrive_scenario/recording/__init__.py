"""Frames, trace hashes, recordings and text output of runs."""

from eidrive_scenario.recording.camera_images import CameraImageWriter
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import Recording, read_recording
from eidrive_scenario.recording.text.csv_writer import CsvWriter
from eidrive_scenario.recording.text.explanation import Explanation
from eidrive_scenario.recording.text.run_log import RunLog
from eidrive_scenario.recording.trace_hash import TraceHash

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
