"""Recordings of traffic in datasets of others, as scenarios that replay them."""
