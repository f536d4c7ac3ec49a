"""The frame: all that happened in one tick; what a run leaves behind, and reading it again."""
