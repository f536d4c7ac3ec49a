"""Rigid bodies, contacts, ray tests and vehicle dynamics in pybullet."""
