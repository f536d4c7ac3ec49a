"""Source text of a faulty criterion, action and condition, whose settings in the scenario select the fault."""

STORYBOARD = """
class FaultySettings(CriterionSettings):
    fault: str


class FaultyCriterion(Criterion):
    settings_type = FaultySettings
    name = "faulty"

    def __init__(self, settings):
        super().__init__(settings)
        self.fault = settings.fault
        if self.fault == "built":
            raise RuntimeError("not built")

    def observe(self, frame):
        if self.fault == "observe" and frame.view.time >= AFTER:
            raise RuntimeError("this criterion fails to observe")

    def verdict(self):
        match self.fault:
            case "surrogate":
                raise OSError("no file 'a" + chr(0xDCFF) + "'")
            case "none":
                return None
            case "nan":
                return Verdict(self.name, math.nan, None, None, "", None, "undefined")
            case "value":
                return Verdict(self.name, True, math.nan, None, "", None, "undefined")
            case "verdict":
                raise ValueError("no verdict")
        return Verdict(self.name, True, None, None, "", None, "fine")

    def metrics(self):
        return None if self.fault == "metrics" else {}


class PlainSettingsCriterion(FaultyCriterion):
    settings_type = dict


class FaultyAction(ActionBehaviour):
    def update(self):
        match self.action.content:
            case "none":
                return None
            case "nan":
                self.context.actors[next(iter(self.context.actors))].motion.set_speed(math.nan)
            case "raises":
                raise LookupError("no such action")
            case "fails below 5" if self.context.actors["Ego"].motion.speed < 4.9:
                raise ValueError("too slow")
        return Status.SUCCESS


class FaultyCondition(Condition):
    def holds(self, context):
        match self.element.value:
            case "none":
                return None
            case "nan":
                return math.nan
            case "raises":
                raise ArithmeticError("undefined")
        return False

    def explain(self, context):
        return "faulty"
"""
