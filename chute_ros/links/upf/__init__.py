"""A Flyfire UPF parachute on a DroneCAN bus."""
