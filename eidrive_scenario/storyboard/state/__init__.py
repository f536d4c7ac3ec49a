"""State of the storyboard that actions and conditions share."""
