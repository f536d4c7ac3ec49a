"""OpenSCENARIO actions as py_trees behaviours, OpenSCENARIO conditions as predicates."""
