"""Work of a node between wire, core and ROS; the same under ROS and in the campaign's time."""
