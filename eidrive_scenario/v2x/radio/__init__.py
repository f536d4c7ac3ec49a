"""The radio: path loss and what stands in between, access to the medium, reception, congestion control."""
