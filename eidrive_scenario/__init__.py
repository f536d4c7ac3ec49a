"""An OpenSCENARIO engine and test harness for cooperative perception."""
