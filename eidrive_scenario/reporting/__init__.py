"""Pages and pictures of what happened."""
