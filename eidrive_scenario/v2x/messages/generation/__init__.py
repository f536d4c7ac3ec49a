"""Message generation rules and message contents."""
