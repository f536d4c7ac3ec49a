"""Runs from Python that a page shows while they are in progress.

Stable: all names.
"""

from eidrive_scenario.reporting.live.live_view import LiveView as LiveView
