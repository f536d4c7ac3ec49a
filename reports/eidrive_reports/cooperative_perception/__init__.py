"""Average precision of cooperative perception: several receivers measure the same frames of one run."""
