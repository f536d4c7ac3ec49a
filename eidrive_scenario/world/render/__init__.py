"""How the world looks: triangles to pixels, and the light on them. numpy alone, so that it is the same everywhere."""
