"""The experiments of the EI-Drive paper, studies of the engine, and the pages that show both."""
