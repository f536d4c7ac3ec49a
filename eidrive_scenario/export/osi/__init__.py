"""ASAM OSI messages and traces from the frames of a recording."""
