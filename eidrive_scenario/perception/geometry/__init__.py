"""Projection, visibility and map context that several detectors share."""
