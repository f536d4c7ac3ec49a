"""Interfaces of actions, conditions and controller models, and the runtime context passed to them."""
