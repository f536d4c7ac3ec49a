"""Paths in scenarios that lead to pipes, devices, folders and files of other kinds: nothing blocks, nothing leaks."""

from __future__ import annotations

import os
import socket
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hostile_scenario import Write
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.library import definition
from eidrive_scenario.files.bounded import MIB, RefusedFileError, read_regular_file
from eidrive_scenario.files.yaml_text import load_yaml_file
from eidrive_scenario.perception.learned.weights import read_arrays

SECRET = "root:x:0:0:hunter2"

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs POSIX")


def output_of(path: Path) -> str:
    """Return the output of `check` and `run` for a file that they reject."""
    texts = []
    for command in (["check", str(path)], ["run", str(path), "--no-record"]):
        result = CliRunner().invoke(app, command)
        assert result.exit_code == 2, result.output
        assert "internal error" not in result.output
        texts.append(result.output)
    return "".join(texts)


@needs_pipes
def test_read_regular_file_special_files_are_refused_at_once(tmp_path: Path) -> None:
    pipe, link, place = tmp_path / "pipe", tmp_path / "link", tmp_path / "socket"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(place))
        for path, kind in (
            (pipe, "a pipe"),
            (link, "a pipe"),
            (tmp_path, "a folder"),
            (place, "a socket"),
            (Path("/dev/zero"), "a device"),
        ):
            if path.exists():
                with pytest.raises(OSError, match=kind):
                    read_regular_file(path, 1000)


def test_read_regular_file_beyond_the_limit_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"x" * 1024)
    assert read_regular_file(file, 1024) == b"x" * 1024
    with pytest.raises(RefusedFileError, match="larger than 0 KiB"):
        read_regular_file(file, 1023)
    with pytest.raises(OSError, match="not valid"):
        read_regular_file("a\0b", 1)
    with pytest.raises(OSError, match=r"File name too long|No such file"):
        read_regular_file("x" * 5000, 1)


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="needs /proc")
def test_read_regular_file_whose_size_is_not_stated_is_bounded() -> None:
    """Files of /proc have a size of 0, whatever they hold."""
    with pytest.raises(RefusedFileError, match="larger than 0 KiB"):
        read_regular_file("/proc/self/maps", 100)


@needs_pipes
def test_check_and_run_pipes_and_devices_as_files_are_refused(write: Write, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    for name in ("C.xosc", "roads.xodr", "weights.npz", "weights.onnx", "trace.csv"):
        (tmp_path / name).symlink_to(pipe)
    profile = tmp_path / "profile.yaml"
    profile.write_text("delay: {kind: trace, file: trace.csv}\n")
    assert "is neither in the folder of the scenario" in output_of(write(road="roads.xodr"))
    assert "no file" in output_of(write(channel=str(pipe)))
    assert "the path leads to a pipe (expected a regular file)" in output_of(write(channel=str(profile)))
    for suffix, more in (("npz", ""), ("onnx", ", classes: [car], input_size: [96, 64]")):
        given = {"detector": "yolov5", "detector_settings": f"{{weights: {tmp_path}/weights.{suffix}{more}}}"}
        assert "no file" in output_of(write(given))
    profile.write_text("delay: {kind: trace, file: /dev/zero}\n")
    assert "the path leads to a device" in output_of(write(channel=str(profile)))
    profile.write_text(f"delay: {{kind: trace, file: {tmp_path}}}\n")
    assert "the path leads to a folder" in output_of(write(channel=str(profile)))


@needs_pipes
def test_check_and_run_a_pipe_as_catalog_does_not_block(write: Write, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "C.xosc")
    path = write(catalogs=f'<ControllerCatalog><Directory path="{tmp_path}"/></ControllerCatalog>')
    content = path.read_text()
    controller = content[content.index("<Controller ") : content.index("</Controller>") + len("</Controller>")]
    path.write_text(content.replace(controller, '<CatalogReference catalogName="C" entryName="e"/>'))
    assert f"{tmp_path}/C.xosc: cannot read: the path leads to a pipe" in output_of(path)
    assert definition(tmp_path / "C.xosc") == "unreadable"
    assert CliRunner().invoke(app, ["check", str(tmp_path)]).exit_code == 2


@pytest.mark.parametrize("column", ["0", "1", "9", "hunter2", "root"])
def test_check_and_run_invalid_trace_is_not_quoted(write: Write, tmp_path: Path, column: str) -> None:
    secret = tmp_path / "secret"
    for content in (f"{SECRET}\n", f"a,b\n1,{SECRET}\n", f"-4711,{SECRET}\n", '"' + SECRET):
        secret.write_text(content)
        path = write(channel=f"{{delay: {{kind: trace, file: {secret}, column: {column}}}}}")
        if content == f"a,b\n1,{SECRET}\n" and column == "0":
            continue  # a trace indeed
        text = output_of(path)
        assert "hunter2" not in text.replace("column: hunter2", "").replace("'hunter2'", "")
        assert "4711" not in text
        assert "0:0" not in text


@pytest.mark.parametrize(
    "content",
    [
        f"<passwd><hunter2></hunter1></passwd>{SECRET}",
        f"<hunter2 a='{SECRET}'/>",
        f"{SECRET}",
        f"<OpenDRIVE><hunter2 {SECRET}/></OpenDRIVE>",
        f"<OpenDRIVE a={SECRET}/>",
        "<OpenDRIVE>&hunter2;</OpenDRIVE>",
        "<OpenDRIVE><hunter2:a/></OpenDRIVE",
        f"<!DOCTYPE {SECRET}><OpenDRIVE/>",
        f'<?xml version="1.0" encoding="hunter2"?>{SECRET}',
        f"<OpenDRIVE><?hunter2 {SECRET}</OpenDRIVE>",
        f'<OpenDRIVE hunter2="1" hunter2="{SECRET}"/>',
    ],
)
def test_check_and_run_xml_that_cannot_be_read_is_not_quoted(write: Write, tmp_path: Path, content: str) -> None:
    file = tmp_path / "other"
    file.write_text(content)
    text = output_of(write(road=str(file)))
    assert "hunter2" not in text
    assert "hunter1" not in text
    path = write(catalogs=f'<ControllerCatalog><Directory path="{file}"/></ControllerCatalog>')
    written = path.read_text()
    controller = written[written.index("<Controller ") : written.index("</Controller>") + len("</Controller>")]
    path.write_text(written.replace(controller, '<CatalogReference catalogName="C" entryName="e"/>'))
    text = output_of(path)
    assert "hunter2" not in text
    assert "hunter1" not in text


@pytest.mark.parametrize(
    "content",
    [
        f"a: [{SECRET}\n",
        f"'{SECRET}",
        "*hunter2",
        "!!hunter2 x",
        "a: 1\n\thunter2: 2",
        "hunter2: 1\nhunter2: 2",
        SECRET,
        "[hunter2]",
    ],
)
def test_check_and_run_yaml_that_cannot_be_read_is_not_quoted(write: Write, tmp_path: Path, content: str) -> None:
    file = tmp_path / "other.yaml"
    file.write_text(content)
    assert "hunter2" not in output_of(write(channel=str(file)))


def test_check_and_run_asn1_module_that_cannot_be_read_is_not_quoted(write: Write, tmp_path: Path) -> None:
    pytest.importorskip("asn1tools")
    file = tmp_path / "secret"
    file.write_text(SECRET)
    text = output_of(write({"asn1_files": str(file)}))
    assert "not a valid ASN.1 module in line 1" in text
    assert "hunter2" not in text


def test_load_yaml_file_that_is_too_large_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "large.yaml"
    file.write_bytes(b"a: 1\n" * 300_000)
    with pytest.raises(SettingError, match="larger than 512 KiB"):
        load_yaml_file(file)


def archive(**members: bytes) -> bytes:
    """A .npz with these members."""
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(f"{name}.npy", content)
    return stream.getvalue()


def array(value: np.ndarray) -> bytes:
    """An array as it is in a .npz."""
    stream = BytesIO()
    np.save(stream, value, allow_pickle=True)
    return stream.getvalue()


def test_read_arrays_returns_arrays_of_numpy_files() -> None:
    stream = BytesIO()
    values = {
        "a": np.arange(6.0).reshape(2, 3),
        "b": np.array("text"),
        "c": np.asfortranarray(np.eye(3, dtype=np.float16)),
    }
    np.savez_compressed(stream, a=values["a"], b=values["b"], c=values["c"])
    found = read_arrays(stream.getvalue())
    assert set(found) == set(values)
    for name, value in values.items():
        np.testing.assert_array_equal(found[name], value)
        assert found[name].dtype == value.dtype


@pytest.mark.exhaustive
def test_read_arrays_hostile_archives_are_refused() -> None:
    with pytest.raises(ValueError, match="Python objects"):
        read_arrays(archive(a=array(np.array([{}], dtype=object))))
    immense = array(np.zeros(3)).replace(b"(3,)", b"(9999999999999,)".ljust(4))
    with pytest.raises(ValueError, match="header"):
        read_arrays(archive(a=immense))
    with pytest.raises(ValueError, match="larger than 512 MiB"):
        read_arrays(archive(a=bytes(300 * MIB), b=bytes(300 * MIB)))
    with pytest.raises(ValueError, match="magic"):
        read_arrays(archive(a=b"no array"))
