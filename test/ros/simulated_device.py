"""What the stories of device_suite need of a simulated device, whatever its link."""

from abc import ABC, abstractmethod


class SimulatedDevice(ABC):
    """A parachute module on this link, as the stories need it."""

    @abstractmethod
    def plug_in(self) -> None:
        """It is on the wire, and speaks often."""

    def plug_in_mute(self) -> None:  # noqa: B027
        """Its wire is there and nobody speaks on it, as a network's is from the start."""

    @abstractmethod
    def fall_silent(self) -> None:
        """It says nothing any more."""

    @abstractmethod
    def speak_again(self) -> None:
        """It speaks as before."""

    @abstractmethod
    def stop_answering(self) -> None:
        """It goes on telling its status, but takes no command."""

    @abstractmethod
    def be_stuck(self) -> None:
        """It acknowledges everything, but what is deployed stays in its pod."""

    @abstractmethod
    def break_down(self) -> str:
        """It says that it is not healthy; a word of the fault it then shows."""

    def clear_the_ground(self) -> None:  # noqa: B027
        """It is where it may be deployed, which most are from the start."""

    @abstractmethod
    def come_to_ground(self) -> None:
        """It refuses to deploy: too near the ground."""

    @abstractmethod
    def commands_to_deploy(self) -> int:
        """How many commands to release have come over the wire."""

    @property
    @abstractmethod
    def deployed(self) -> bool:
        """The parachute has really left its pod."""
