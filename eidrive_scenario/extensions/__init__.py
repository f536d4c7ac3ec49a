"""What a name refers to: extensions by entry points, files of the library and of a project, and their settings."""
