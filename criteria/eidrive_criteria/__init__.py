"""Pass/fail criteria."""
