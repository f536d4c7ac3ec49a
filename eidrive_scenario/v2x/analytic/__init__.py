"""Published analytic models of packet delivery on a channel that many vehicles share."""
