"""Source text of faulty detectors."""

DETECTORS = '''
class Hangs(Detector):
    def detect(self, readings):
        while readings.time >= AFTER:
            time.sleep(0.001)
        return Detections(readings.time)


class Swallows(Detector):
    """Catches what interrupts it once, as careless code does."""

    def detect(self, readings):
        try:
            while readings.time >= AFTER:
                time.sleep(0.001)
        except BaseException:
            pass
        while readings.time >= AFTER:
            time.sleep(0.001)
        return Detections(readings.time)


class Sleeps(Detector):
    def detect(self, readings):
        time.sleep(3600.0)


class HangsInC(Detector):
    """Never returns to the interpreter, and holds its lock."""

    def detect(self, readings):
        if readings.time >= AFTER:
            NATIVE.pthread_mutex_lock(HELD)  # in detect
        return Detections(readings.time)


class HangsInCLater(HangsInC):
    """The same, when some seconds are recorded."""

    def detect(self, readings):
        return super().detect(readings) if readings.time >= 2.5 else Detections(readings.time)


class Deadlocks(Detector):
    """Waits in native code for a lock that it holds, without the lock of the interpreter; signals do not end that."""

    def detect(self, readings):
        if readings.time >= AFTER:
            library, mutex = ctypes.CDLL(None), ctypes.create_string_buffer(64)
            for _ in range(2):
                library.pthread_mutex_lock(mutex)
        return Detections(readings.time)


class EndsProcess(Detector):
    def detect(self, readings):
        os._exit(0)


class KillsProcess(Detector):
    def detect(self, readings):
        os.kill(os.getpid(), signal.SIGKILL)


class KillsProcessWhenBuilt(KillsProcess):
    def __init__(self):
        os.kill(os.getpid(), signal.SIGKILL)


class HangsWhenBuilt(Detector):
    def __init__(self):
        while True:
            time.sleep(0.001)

    def detect(self, readings):
        return Detections(readings.time)


class HangsInCWhenBuilt(Detector):
    def __init__(self):
        NATIVE.pthread_mutex_lock(HELD)  # in __init__

    def detect(self, readings):
        return Detections(readings.time)


class Exits(Detector):
    def detect(self, readings):
        if readings.time >= AFTER:
            sys.exit(0)
        return Detections(readings.time)


class ExitsWhenBuilt(Detector):
    def __init__(self):
        sys.exit(0)

    def detect(self, readings):
        return Detections(readings.time)


class WrongSettings(Detector):
    def __init__(self):
        raise SettingError(Diagnostic("no weights", "give weights"))

    def detect(self, readings):
        return Detections(readings.time)


class Raises(Detector):
    def detect(self, readings):
        return self.helper(readings)

    def helper(self, readings):
        raise KeyError("no such camera")


class RaisesInNumpy(Detector):
    def detect(self, readings):
        np.linalg.inv(np.zeros((2, 2)))


class ReturnsNaN(Detector):
    def detect(self, readings):
        boxes = np.array([[30.0, 0.0, 0.75, math.nan, 1.8, 1.5, 0.0]])
        return Detections(readings.time, boxes, np.ones(1), ("car",), np.zeros((1, 2)), np.zeros((1, 2, 2)))


class NegativeSize(Detector):
    def detect(self, readings):
        boxes = np.array([[30.0, 0.0, 0.75, -4.5, 1.8, 1.5, 0.0]])
        return Detections(readings.time, boxes, np.ones(1), ("car",), np.zeros((1, 2)), np.zeros((1, 2, 2)))


class ReturnsNone(Detector):
    def detect(self, readings):
        return None


class WrongShape(Detector):
    def detect(self, readings):
        return Detections(readings.time, np.zeros((1, 6)), np.ones(1), ("car",))


class ListOfBoxes(Detector):
    def detect(self, readings):
        return [[30.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0]]


class Yields(Detector):
    def detect(self, readings):
        yield Detections(readings.time)


class FewArguments(Detector):
    def detect(self):
        return Detections(0.0)


class Lacks(Detector):
    pass


class NoDetector:
    def detect(self, readings):
        return Detections(readings.time)


def a_function(readings):
    return Detections(readings.time)


class NoSignals(Detector):
    detectable_signals = frozenset({"light"})

    def detect(self, readings):
        return Detections(readings.time)

    def signals(self):
        return None
'''
