"""Tracking of detections over time."""
