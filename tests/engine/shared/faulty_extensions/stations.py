"""Source text of faulty extensions of stations except detectors: sensor, tracker, fusion, planners, a channel."""

STATIONS = """
class TrackerNone(TrackingMethod):
    def update(self, detections, in_view=None):
        return None

    def predict(self, time):
        return None


class FaultySensorSettings(SensorSettings):
    kind: str = "faulty_sensor"
    fault: str = "none"


class FaultySensor(Sensor):
    settings_type = FaultySensorSettings

    def __init__(self, settings, spec, name, seed=0):
        if settings.fault == "built":
            raise OSError("no such device")
        super().__init__(settings, spec, name, seed)

    def read(self, scene, view, row):
        if self.settings.fault == "read" and view.time >= AFTER:
            raise TimeoutError("no answer of the device")


class FusionNaN(FusionMethod):
    def fuse(self, reports, now):
        return Detections(now, np.full((1, 7), math.inf), np.ones(1), ("car",), np.zeros((1, 2)), np.zeros((1, 2, 2)))


class FusionNone(FusionMethod):
    def fuse(self, reports, now):
        pass


class FusionNoAge(FusionNone):
    max_report_age = None


class FusionShortBatch(FusionNone):
    @classmethod
    def fuse_batch(cls, methods, reports, now):
        return []


class FusionMergesNone(FusionNone):
    shares = "points"

    def merge_readings(self, readings, alone=None):
        return None


class FusionHearRaises(FusionMethod):
    def add_report(self, report):
        raise ZeroDivisionError("division by zero")

    def fuse(self, reports, now):
        return Detections(now)


class PlannerNone(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        return None


class PlannerNaN(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        plan = super().plan(ego, objects, goal, now)
        return Plan(plan.points, plan.speeds * math.nan, "undefined")


class PlannerAbsurd(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        plan = super().plan(ego, objects, goal, now)
        return Plan(plan.points, np.full(len(plan.speeds), 1e300), "absurd")


class PlannerOnePoint(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        plan = super().plan(ego, objects, goal, now)
        return Plan(plan.points[:1], plan.speeds[:1], "short")


class PlannerStands(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        plan = super().plan(ego, objects, goal, now)
        return Plan(np.repeat(plan.points[:1], 5, axis=0), plan.speeds[:5], "the same point")


class PlannerStaticRaises(RoutePlanner):
    @staticmethod
    def plan(ego, objects, goal, now):
        raise RuntimeError("from a static method")


class PlannerArguments(RoutePlanner):
    def __init__(self, settings):
        pass


class ControllerNone(VehicleController):
    def control(self, ego, plan):
        return None


class ControllerNaN(VehicleController):
    def control(self, ego, plan):
        return Control(0.0, math.nan, 0.0)


class ControllerText(VehicleController):
    def control(self, ego, plan):
        return Control("full", 0.0, 0.0)


class FaultyProfile(ChannelProfile):
    fault: str = "none"


class FaultyChannel(LinkChannel):
    settings_type = FaultyProfile

    def __init__(self, profile, seed):
        super().__init__()
        self.profile = profile

    def transmission_outcome(self, message, receiver, now):
        match self.profile.fault:
            case "nan":
                return math.nan
            case "inf":
                return math.inf
            case "none":
                return None
            case "arrives":
                return True
            case "array":
                return np.array([0.1])
            case "raises":
                raise OSError("no radio")
        return 0.1

    def min_message_interval(self, station):
        return math.nan if self.profile.fault == "interval" else 0.0

    def deliver(self, receiver, now):
        return None if self.profile.fault == "deliver" else super().deliver(receiver, now)
"""
