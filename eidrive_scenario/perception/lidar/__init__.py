"""Object detection in LiDAR point clouds."""
