"""An OpenSCENARIO engine and test harness for cooperative perception."""

__version__ = "0.2.0"
