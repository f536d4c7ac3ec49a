"""Detectors with networks trained on images of this simulation. Torch is imported only when one is created."""
