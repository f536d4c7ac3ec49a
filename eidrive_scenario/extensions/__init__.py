"""Names and their meaning: extensions by entry points, files of the library and of a project, and their settings."""
