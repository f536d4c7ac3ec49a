"""Bounded reading and atomic writing of files; XML and YAML from untrusted sources."""
