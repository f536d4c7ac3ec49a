"""Motion of actors along lanes, routes and trajectories."""
