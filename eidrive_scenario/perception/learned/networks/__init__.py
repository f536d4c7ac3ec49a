"""Network architectures, their losses and box operations."""
