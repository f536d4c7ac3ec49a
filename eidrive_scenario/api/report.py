"""Pictures, pages and tables of runs, for notebooks and scripts.

Stable: all names.
"""

from eidrive_scenario.experiments.sweeps.results import read_results as read_results
from eidrive_scenario.reporting.notebook import Picture as Picture
from eidrive_scenario.reporting.notebook import RunDisplay as RunDisplay
from eidrive_scenario.reporting.notebook import draw as draw
from eidrive_scenario.reporting.notebook import show as show
from eidrive_scenario.reporting.notebook import write_replay as write_replay
from eidrive_scenario.reporting.notebook import write_report as write_report
