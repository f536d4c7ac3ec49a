"""The storyboard as a behaviour tree: elements, events, triggers."""
