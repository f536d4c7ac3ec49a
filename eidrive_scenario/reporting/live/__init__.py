"""Page of a run in progress, by a local server."""
