"""Reproduction of the tables and figures of the EI-Drive paper: `eidrive reproduce`."""
