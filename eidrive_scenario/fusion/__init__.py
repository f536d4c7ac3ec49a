"""Boxes of several senders become one picture."""
