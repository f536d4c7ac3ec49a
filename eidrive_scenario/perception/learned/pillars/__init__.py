"""Detector `pillars`: a network on the bird's-eye view of lidar points, whose features stations can exchange."""
