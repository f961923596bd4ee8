"""DroneCAN (UAVCAN version 0): frames, transfers and the standard services, without any I/O."""
