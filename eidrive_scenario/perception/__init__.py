"""Perception: from sensor readings to detections. The only package that imports torch and ONNX Runtime."""
