"""Conditions of the standard, one family per module."""
