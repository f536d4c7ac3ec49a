"""Stand-ins for controllers of other tools, one per module."""
