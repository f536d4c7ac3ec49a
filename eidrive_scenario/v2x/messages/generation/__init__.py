"""When a station says something, and what it puts into the message."""
