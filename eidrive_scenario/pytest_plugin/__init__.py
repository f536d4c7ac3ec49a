"""pytest plugin that runs scenario files: `pytest xosc/coop --eidrive-seeds 3 --eidrive-channel ideal,none`.

A `.xosc` file on the command line, or below a folder on the command line, becomes one test per channel and seed. A
parameter value distribution becomes as many tests for each of its runs, up to `--eidrive-max-runs` runs. The ini option
`eidrive_paths` selects other folders. Tests in Python use the marker `scenario` and the fixture `run_scenario`.
"""

from __future__ import annotations

from eidrive_scenario.pytest_plugin.failures import pytest_report_teststatus as pytest_report_teststatus
from eidrive_scenario.pytest_plugin.failures import pytest_runtest_makereport as pytest_runtest_makereport
from eidrive_scenario.pytest_plugin.failures import pytest_runtest_setup as pytest_runtest_setup
from eidrive_scenario.pytest_plugin.fixture import pytest_generate_tests as pytest_generate_tests
from eidrive_scenario.pytest_plugin.fixture import pytest_itemcollected as pytest_itemcollected
from eidrive_scenario.pytest_plugin.fixture import run_scenario as run_scenario
from eidrive_scenario.pytest_plugin.items import pytest_collect_file as pytest_collect_file
from eidrive_scenario.pytest_plugin.items import pytest_sessionfinish as pytest_sessionfinish
from eidrive_scenario.pytest_plugin.items import pytest_testnodedown as pytest_testnodedown
from eidrive_scenario.pytest_plugin.options import pytest_report_header as pytest_report_header
from eidrive_scenario.pytest_plugin.reports import pytest_terminal_summary as pytest_terminal_summary
from eidrive_scenario.pytest_plugin.session import pytest_addoption as pytest_addoption
from eidrive_scenario.pytest_plugin.session import pytest_configure as pytest_configure
from eidrive_scenario.pytest_plugin.session import pytest_configure_node as pytest_configure_node
from eidrive_scenario.pytest_plugin.session import pytest_handlecrashitem as pytest_handlecrashitem
from eidrive_scenario.pytest_plugin.session import pytest_load_initial_conftests as pytest_load_initial_conftests
from eidrive_scenario.pytest_plugin.session import pytest_unconfigure as pytest_unconfigure
