"""Rules of `eidrive check` and the reports on scenarios, catalogs, roads and distributions."""
