"""Detector `pillars`: a network on lidar points in plan view, whose features stations can exchange."""
