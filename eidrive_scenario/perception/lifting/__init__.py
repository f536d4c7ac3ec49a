"""Lifting of image detections to boxes in the world."""
