"""Typed values, expressions and parameters."""
