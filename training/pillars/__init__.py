"""Training of the detector `pillars` on lidar scans that are cast on a GPU."""
