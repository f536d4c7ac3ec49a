"""Resolution of OpenSCENARIO positions and distances."""
