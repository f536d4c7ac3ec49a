"""Network architectures, their sizes, and suppression of overlapping boxes."""
