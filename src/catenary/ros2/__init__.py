"""ROS 2: topics and services of a running loop. It attaches through `share` and `remote`."""
