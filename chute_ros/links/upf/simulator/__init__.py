"""A simulated UPF parachute: controller and trigger."""
