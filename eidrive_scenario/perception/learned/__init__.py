"""Detectors on pictures, learned from pictures of this world. Torch is imported only when one of them is built."""
