"""Statistics of links: delivery, delay, age of information."""
