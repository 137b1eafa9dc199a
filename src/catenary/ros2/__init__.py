"""Bridge between a running machine and a ROS 2 graph."""
