"""V2X messages: content, size, encoding, generation rules."""
