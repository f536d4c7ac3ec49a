"""From readings to detections. The only room that imports torch."""
