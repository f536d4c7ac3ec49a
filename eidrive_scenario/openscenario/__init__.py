"""OpenSCENARIO XML 1.0 to 1.3: files into a frozen, checked Scenario."""
