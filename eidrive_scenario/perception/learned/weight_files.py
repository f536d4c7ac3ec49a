"""Weight files as untrusted input: size, permission to execute TorchScript, and arrays of .npz files."""

from __future__ import annotations

import io
import math
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.files.bounded import MIB, is_regular_file, read_regular_file, reason_of

MAX_BYTES = 512 * MIB
"""Maximum size of a weight file, and of all arrays in a .npz together."""
MAX_SIDE = 8192
"""Maximum width and height of a network's input [px]."""
MAX_CLASSES = 10_000
"""Maximum number of classes of a network."""
DEFAULT_CONFIDENCE = 0.35
"""Minimum score of a detection if neither the settings nor the weights state one."""
ALLOW_TORCHSCRIPT = "EIDRIVE_ALLOW_TORCHSCRIPT"
"""Environment variable: 1 permits TorchScript weights, as the option --allow-torchscript does."""
OWN_SUFFIX, ONNX_SUFFIX, TORCHSCRIPT_SUFFIX = ".npz", ".onnx", ".pt"


def torchscript_is_allowed(option: bool) -> bool:
    """Return whether the option or the environment variable permits that weights execute code."""
    return option or os.environ.get(ALLOW_TORCHSCRIPT) == "1"


def refused_torchscript(path: Path) -> SettingError:
    """Return the error for TorchScript weights without permission."""
    message = f"weights {quoted(str(path))} are TorchScript, which can execute any code with your rights"
    hint = f"export the model to ONNX; or, if you trust it, run with --allow-torchscript or {ALLOW_TORCHSCRIPT}=1"
    return SettingError(Diagnostic(message, hint))


def check_weights_exist(path: Path) -> None:
    """Raise SettingError if the path is not a regular file. The file is not read."""
    if not is_regular_file(path):
        hint = "check `weights` of the detector's settings"
        raise SettingError(Diagnostic(f"no file {quoted(str(path))} with weights", hint))


def read_weights(path: Path) -> bytes:
    """Return the content of a file of weights. Raise SettingError if it cannot be read, or is too large."""
    try:
        return read_regular_file(path, MAX_BYTES)
    except OSError as error:
        message = f"weights {quoted(str(path))} cannot be read: {reason_of(error)}"
        raise SettingError(Diagnostic(message, "check `weights` of the detector's settings")) from error


def read_arrays(content: bytes) -> Mapping[str, NDArray[Any]]:
    """Return the arrays of a .npz, by name.

    Raise ValueError or zipfile.BadZipFile if the file is damaged, holds Python objects, or unpacks to more than
    MAX_BYTES. Sizes are checked before memory is allocated.
    """
    arrays: dict[str, NDArray[Any]] = {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = archive.infolist()
        if sum(member.file_size for member in members) > MAX_BYTES:
            raise ValueError(f"the arrays are larger than {MAX_BYTES // MIB} MiB")
        for member in members:
            with archive.open(member) as stream:
                data = stream.read(member.file_size)
            arrays[member.filename.removesuffix(".npy")] = _array(data)
    return arrays


def _array(data: bytes) -> NDArray[Any]:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(version)
    if read_header is None:
        raise ValueError("an array has an unknown format version")
    shape, fortran_order, dtype = read_header(stream)
    if dtype.hasobject:
        raise ValueError("an array holds Python objects, which are not supported")
    body = data[stream.tell() :]
    if any(side < 0 for side in shape) or math.prod(shape) * dtype.itemsize != len(body):
        raise ValueError("the length of an array differs from its header")
    array = np.frombuffer(body, dtype=dtype)
    return array.reshape(shape, order="F" if fortran_order else "C")
