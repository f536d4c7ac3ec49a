"""Data model of OpenDRIVE maps: roads, lanes, curves, polynomials and positions."""
