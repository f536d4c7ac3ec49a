"""Custom action `eidrive.sumo`: start of the traffic of SUMO."""

from __future__ import annotations

import importlib.util

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, install_command, model, traffic
from eidrive_scenario.api.common import EPSILON, ScenarioError, SettingError, SimulationError


class SumoAction(ActionBehaviour):
    """Start of the traffic of SUMO, which continues to the end of the run.

    `<CustomCommandAction type="eidrive.sumo">{network: town.net.xml, routes: [town.rou.xml]}</CustomCommandAction>`
    """

    immediate = True
    action: model.CustomCommandAction

    def configure(self) -> None:
        """Require a road network, a time step of SUMO and libsumo, and check the files."""
        roads = self.require_roads()
        milliseconds = self.context.step * 1000.0
        if abs(milliseconds - round(milliseconds)) > EPSILON or milliseconds < 1.0:
            text = f"got {self.context.step:g} s; expected a multiple of 0.001 s"
            raise self.error("SUMO cannot simulate the time step of the run", text)
        if importlib.util.find_spec("libsumo") is None:
            raise self.error("libsumo is not installed", f"run: {install_command('sumo')}")
        try:
            self._files: traffic.SumoFiles = traffic.sumo_files(self.action, roads)
        except SettingError as error:
            raise ScenarioError(error.at(self.action.source, self.action.line).diagnostics) from error

    def update(self) -> Status:
        """Start SUMO."""
        if self.context.sumo is not None:
            raise self.error("the traffic of SUMO has started already", "start it once, with all files of routes")
        try:
            self.context.start_sumo(self._files)
        except SimulationError as error:
            raise self.error(str(error)) from error
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the network."""
        return f"traffic of SUMO on {self._files.name}"
