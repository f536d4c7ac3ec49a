"""Messages of a station: generation, content, and the line of sight of its radio links."""
