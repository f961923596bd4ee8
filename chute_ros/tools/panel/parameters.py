"""The parameters of the panel."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.settings import Settings, parameter, parameters_of

NODE = "panel"


@dataclass(frozen=True)
class PanelSettings(Settings):
    """All parameters of the node."""

    host: str = parameter(
        "127.0.0.1",
        "address on which it listens; 0.0.0.0: all of this computer, for phones and laptops on "
        "its network",
    )
    port: int = parameter(8080, "TCP port on which it listens", 1, 65535)
    host_names: tuple[str, ...] = parameter(
        ("",),
        "names under which browsers may ask for it besides localhost, this computer's own name, "
        "with and without .local, and addresses in numbers",
    )
    allow_commands: bool = parameter(
        False,
        "who has logged in may arm, disarm, kill, deploy, reset and set the mode; needs "
        "password_file",
    )
    password_file: str = parameter(
        "",
        "file with the password, one line of 10 characters or more, that only its user may read "
        "(chmod 600); empty: nobody can log in",
    )
    certificate_file: str = parameter(
        "", "certificate chain (PEM) for https, with key_file; empty: http"
    )
    key_file: str = parameter("", "private key (PEM) of certificate_file")
    bench: bool = parameter(
        False,
        "show what can be done to a simulated vehicle (services sim/...); everybody who sees the "
        "page may do it",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.allow_commands and not self.password_file:
            raise self.contradiction(
                "need a password: set password_file, or leave allow_commands false",
                *("allow_commands", "password_file"),
            )
        if bool(self.certificate_file) is not bool(self.key_file):
            raise self.contradiction("need both or neither", "certificate_file", "key_file")


PARAMETERS = parameters_of(PanelSettings)
