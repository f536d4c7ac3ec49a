"""Control of a vehicle along a planned trajectory."""
