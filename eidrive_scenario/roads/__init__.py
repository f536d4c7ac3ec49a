"""OpenDRIVE roads: lane and road coordinates to x, y, z and back, and routes over lanes."""
