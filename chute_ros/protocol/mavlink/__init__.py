"""What everything shares that speaks MAVLink: the link, the simulators, the campaign."""
