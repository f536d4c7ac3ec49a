"""Attachments in JUnit files: the lines `[[ATTACHMENT|path]]` that GitLab and Jenkins read."""

from __future__ import annotations

import os
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from _pytest.junitxml import xml_key  # the JUnit writer has no public interface for elements of a test case

_SYSTEM_OUT = "system-out"


def register(config: pytest.Config) -> None:
    """Add attachments to the JUnit file of this session, if it writes one."""
    if config.getoption("xmlpath", None) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Attachments(config), "eidrive_junit_attachments")


def attachment_lines(report: Any) -> list[str]:
    """Return a line for each attachment of a report whose test did not pass."""
    facts: Mapping[str, Any] = getattr(report, "eidrive", {})
    return [f"[[ATTACHMENT|{_path(path)}]]" for path in facts.get("attachments", ())]


def _path(path: str) -> str:
    """Return a path relative to the project of a GitLab job; an absolute path elsewhere, as Jenkins requires."""
    project = os.environ.get("CI_PROJECT_DIR")
    full = Path(os.path.abspath(path))
    if project and full.is_relative_to(os.path.abspath(project)):
        return full.relative_to(os.path.abspath(project)).as_posix()
    return str(full)


class _Attachments:
    """Plugin that completes the test case of a report when the JUnit writer has closed it."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None, object, object]:
        """Append the attachments to `system-out`, which exists only with the ini option `junit_logging`."""
        xml = self._config.stash.get(xml_key, None)
        lines = attachment_lines(report)
        is_last = report.when == "teardown" or getattr(report, "eidrive_is_crash", False)
        if xml is None or not lines or not is_last:
            return (yield)
        reporter = xml.node_reporter(report)
        result = yield
        if report.when != "teardown":  # no further report follows
            reporter.append(_system_out(lines))
            return result
        case: ElementTree.Element = reporter.to_xml()
        existing = case.find(_SYSTEM_OUT)
        if existing is None:
            case.append(_system_out(lines))
        else:
            existing.text = "\n".join([(existing.text or "").rstrip(), *lines, ""])
        return result


def _system_out(lines: list[str]) -> ElementTree.Element:
    element = ElementTree.Element(_SYSTEM_OUT)
    element.text = "\n".join([*lines, ""])
    return element
