"""Rules of the standard on values, names and references."""
