"""Object detection in lidar point clouds."""
