"""Topics with the schemas of Foxglove, for Foxglove and Lichtblick."""
