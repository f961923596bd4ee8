"""The Flyfire UPF parachute on DroneCAN, seen from the vehicle."""
