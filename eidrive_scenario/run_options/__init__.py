"""Options of a run: their table, and the forms of their values."""

from eidrive_scenario.run_options.forms import NO_COOPERATION as NO_COOPERATION
from eidrive_scenario.run_options.forms import Criteria as Criteria
from eidrive_scenario.run_options.forms import Form as Form
from eidrive_scenario.run_options.forms import Seconds as Seconds
from eidrive_scenario.run_options.forms import Stacks as Stacks
from eidrive_scenario.run_options.forms import Switch as Switch
from eidrive_scenario.run_options.forms import YamlSource as YamlSource
from eidrive_scenario.run_options.forms import as_setting_text as as_setting_text
from eidrive_scenario.run_options.forms import check_seconds as check_seconds
from eidrive_scenario.run_options.table import DEFAULT_SEED as DEFAULT_SEED
from eidrive_scenario.run_options.table import FLAGS as FLAGS
from eidrive_scenario.run_options.table import OPTIONS as OPTIONS
from eidrive_scenario.run_options.table import PytestForm as PytestForm
from eidrive_scenario.run_options.table import RunOption as RunOption
from eidrive_scenario.run_options.table import RunSettings as RunSettings
from eidrive_scenario.run_options.table import checked_settings as checked_settings
from eidrive_scenario.run_options.table import diagnostic_with_option_names as diagnostic_with_option_names
from eidrive_scenario.run_options.table import option_of as option_of
from eidrive_scenario.run_options.table import options_of as options_of
from eidrive_scenario.run_options.table import with_option_names as with_option_names
