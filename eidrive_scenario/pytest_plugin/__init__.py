"""pytest plugin that runs scenario files: `pytest xosc/coop --eidrive-seeds 3 --eidrive-channel ideal,none`.

A `.xosc` file on the command line, or below a folder on the command line, becomes one test per channel and seed. A
parameter value distribution becomes as many tests for each of its runs, up to `--eidrive-max-runs` runs. The ini option
`eidrive_paths` selects other folders. Tests in Python use the marker `scenario` and the fixture `run_scenario`.
"""

from __future__ import annotations

from eidrive_scenario.pytest_plugin.failures import (
    pytest_report_teststatus,
    pytest_runtest_makereport,
    pytest_runtest_setup,
)
from eidrive_scenario.pytest_plugin.fixture import pytest_generate_tests, run_scenario
from eidrive_scenario.pytest_plugin.items import pytest_collect_file, pytest_sessionfinish, pytest_testnodedown
from eidrive_scenario.pytest_plugin.options import pytest_report_header
from eidrive_scenario.pytest_plugin.reports import pytest_terminal_summary
from eidrive_scenario.pytest_plugin.session import (
    pytest_addoption,
    pytest_configure,
    pytest_configure_node,
    pytest_handlecrashitem,
    pytest_load_initial_conftests,
    pytest_unconfigure,
)

__all__ = [
    "pytest_addoption",
    "pytest_collect_file",
    "pytest_configure",
    "pytest_configure_node",
    "pytest_generate_tests",
    "pytest_handlecrashitem",
    "pytest_load_initial_conftests",
    "pytest_report_header",
    "pytest_report_teststatus",
    "pytest_runtest_makereport",
    "pytest_runtest_setup",
    "pytest_sessionfinish",
    "pytest_terminal_summary",
    "pytest_testnodedown",
    "pytest_unconfigure",
    "run_scenario",
]
