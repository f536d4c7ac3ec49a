"""The world: bodies, motion, contacts, rays and pictures. The only room that imports pybullet."""
