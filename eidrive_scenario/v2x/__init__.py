"""Messages between stations and models of the channels that carry them."""
