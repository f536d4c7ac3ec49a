"""Files of other tools from recordings: ASAM OSI traces, Foxglove topics, tables."""
