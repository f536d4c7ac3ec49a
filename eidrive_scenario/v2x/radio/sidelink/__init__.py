"""Sidelinks of C-V2X Mode 4 and NR-V2X Mode 2: sensing, resource selection, medium access."""
