"""Traffic of SUMO: its files, and the simulation that runs beside the world."""
