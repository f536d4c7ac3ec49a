"""Radio channel: link budget, medium access, reception, congestion control."""
