"""Sites, sources and sinks of background traffic."""
