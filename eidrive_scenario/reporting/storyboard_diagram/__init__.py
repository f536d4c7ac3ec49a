"""The storyboard as a diagram: boxes, layout, SVG."""
