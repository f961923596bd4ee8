"""What a node does between wire, core and ROS; the same under ROS and in the campaign's time."""
