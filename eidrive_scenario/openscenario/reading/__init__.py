"""XML documents to model objects."""
