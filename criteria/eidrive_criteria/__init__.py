"""Pass/fail criteria, one per module. Each criterion aggregates frames and imports only the API of the engine."""
