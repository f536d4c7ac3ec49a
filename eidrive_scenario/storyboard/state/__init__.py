"""State of the storyboard that conditions read and actions request changes of."""
