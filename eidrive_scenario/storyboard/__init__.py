"""The standard's state machine on py_trees."""
