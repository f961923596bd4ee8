"""An umbilical link with all its commands and dumps, driven by a program."""

from __future__ import annotations

from chute_ros.links.umbilical.protocol.commands import KINDS
from chute_ros.links.umbilical.protocol.config import DeployStage, UmbilicalConfig
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.links.umbilical.protocol.scheduler import HEARTBEAT
from fuzz.program import Program
from fuzz.target import Target, WrongError
from fuzz.targets.linked import Linked
from fuzz.targets.umbilical_lines import bytes_of, layouts

_NAMES = (*KINDS, "set_target", "no such command")
#: Token -> the name of its command.
_TOKENS = {kind.command.token: name for name, kind in KINDS.items()}


class UmbilicalLinked(Linked):
    """One link, and what it was asked for."""

    def __init__(self) -> None:
        config = UmbilicalConfig(deploy=DeployStage.NEXT)
        super().__init__(UmbilicalLink(config, list(layouts())))
        self._port = 0
        self._link.wire_opened(self._now)
        self._steps = (
            self._wait,
            self._to_next_deadline,
            self._hear,
            self._hear,
            self._hear,
            self._talk,
            self._command,
            self._deploy,
            self._arm,
            self._target,
            self._block,
            self._cable,
            self._owner,
        )
        # What comes right after the opening is of before.
        self._now += 1.0
        self._receive(b"the first line may be cut\n")
        self._now += 1.0

    # -- steps of a program ----------------------------------------------------------------------

    def _receive(self, data: bytes) -> None:
        self._link.receive(data, self._now, ("port", self._port))

    def _hear(self, p: Program) -> None:
        self._receive(bytes_of(p))

    def _talk(self, p: Program) -> None:
        """Three ordinary records, after which a layout is believed."""
        layout, mode, clock = p.choice(layouts()), p.byte() % 8, p.byte()
        for number in range(3):
            fields = ["0"] * layout.count
            fields[layout.index["flight_mode"]] = str(mode)
            fields[layout.index["ms_since_boot_cfc"]] = str(clock * 1000 + number * 100)
            self._receive(f"$TELEM,{','.join(fields)}\n".encode())
            self._now += 0.1

    def _command(self, p: Program) -> None:
        name = p.choice(_NAMES)
        self._link.command(self._orders.begin(name), name, p.flag(), self._now)

    def _deploy(self, p: Program) -> None:
        token = self._orders.begin("deploy")
        self._link.deploy(token, p.flag(), self._now, p.flag())

    def _arm(self, p: Program) -> None:
        arm = p.flag()
        token = self._orders.begin("key_arm" if arm else "key_disarm")
        self._link.arm(token, arm, p.byte() % 3, self._now)

    def _target(self, p: Program) -> None:
        values = tuple(p.whole(4) / 1e7 for _ in range(p.byte() % 6))
        self._link.set_target(self._orders.begin("set_target"), values, self._now)

    def _block(self, p: Program) -> None:
        self._link.flight_block("a reason" if p.flag() else "", self._now)

    def _cable(self, p: Program) -> None:
        self._link.stream_ended(("port", self._port))
        if p.flag():
            self._port = (self._port + 1) % 4
            self._link.wire_opened(self._now)

    # -- what comes of it ------------------------------------------------------------------------

    def _turn(self, now: float) -> None:
        super()._turn(now)
        self._link.vehicle_state(now)

    def _left(self, token: bytes) -> None:
        if token == HEARTBEAT.token:
            return
        name = "set_target" if token.startswith(b"<T,") else _TOKENS.get(token)
        if name is None:
            raise WrongError(f"{token!r} left the link: it is no command")
        self._orders.left(
            token.decode(), (name, "deploy") if name in ("drogue", "main") else (name,)
        )


TARGETS = (
    Target("umbilical.link", "the link with its commands and dumps", UmbilicalLinked, longest=512),
)
