"""Delay and loss models of single links."""
