"""Commands that install the distribution again, by the file direct_url.json of PEP 610."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

from eidrive_scenario.base import installation

GIT = {
    "url": "https://example.org/a/b.git",
    "vcs_info": {"vcs": "git", "commit_id": "ab12", "requested_revision": "v1"},
}
WHEEL = {"url": "file:///tmp/eidrive_scenario-0.2.0-py3-none-any.whl", "archive_info": {}}


@pytest.mark.parametrize(
    ("origin", "address"),
    [
        (GIT, "git+https://example.org/a/b.git@ab12"),
        ({**GIT, "subdirectory": "engine"}, "git+https://example.org/a/b.git@ab12#subdirectory=engine"),
        (WHEEL, WHEEL["url"]),
        ({}, None),
        ({"url": "file:///removed", "dir_info": {}}, None),
    ],
)
def test_command_names_the_address_of_the_installation(
    origin: dict[str, Any], address: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(installation, "_origin", lambda: origin)
    *command, argument = shlex.split(installation.install_command("onnx"))
    requirement = Requirement(argument)
    assert command == ["pip", "install"]
    assert (requirement.name, requirement.extras, requirement.url) == ("eidrive-scenario", {"onnx"}, address)
    assert Requirement(f"eidrive-scenario{installation.requirement_source()}").url == address


@pytest.mark.parametrize("editable", [False, True])
def test_command_names_the_folder_of_the_installation(
    editable: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "a b"
    folder.mkdir()
    origin = {"url": folder.as_uri(), "dir_info": {"editable": editable}}
    monkeypatch.setattr(installation, "_origin", lambda: origin)
    expected = ["pip", "install", *(["-e"] if editable else []), f"{folder}[onnx]"]
    assert shlex.split(installation.install_command("onnx")) == expected
    assert installation.requirement_source() == ""
