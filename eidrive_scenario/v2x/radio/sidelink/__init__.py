"""C-V2X sidelink Mode 4: sensing, resource selection, reception."""
