"""Pass/fail criteria: one per file, each a fold over frames. They import the engine's api only."""
