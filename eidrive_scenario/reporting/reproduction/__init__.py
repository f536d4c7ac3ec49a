"""Figures and page of `eidrive reproduce`."""
