"""Motion along lanes, lane graph, routes and distances."""
