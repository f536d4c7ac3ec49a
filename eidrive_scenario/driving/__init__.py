"""From the route to the pedals, and the agent that ties a station together."""
