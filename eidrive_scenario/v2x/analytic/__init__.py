"""How a channel shared by many vehicles fares: the published analytic models of packet delivery."""
