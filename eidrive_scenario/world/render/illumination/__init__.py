"""Light sources, shadows and the sky."""
