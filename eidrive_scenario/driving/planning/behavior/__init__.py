"""Planner `behavior`: proposals along the route, rolled out against predicted objects and scored."""
