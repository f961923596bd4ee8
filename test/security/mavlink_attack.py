"""A MAVLink network with a key, a module that signs, and somebody else on the wire."""

from __future__ import annotations

import math
import time
from collections import Counter
from typing import Any

from chute_msgs.msg import LinkHeartbeat
from diagnostic_msgs.msg import DiagnosticArray
from mavlink_bench import Autopilot, Module, Network
from node_bench import Bench

from chute_ros.model import DeploymentTrigger
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import NOISE, FrameEncoder
from chute_ros.protocol.mavlink.signing import (
    REPLAYED,
    UNSIGNED,
    WRONG_SIGNATURE,
    Signer,
    SigningClock,
    Verifier,
)

KEY, OTHER_KEY = bytes(range(1, 33)), bytes(range(101, 133))
#: The module's own ids and its autopilot's.
CHUTE, AUTOPILOT = (1, 161), (1, 1)
REASONS = (UNSIGNED, WRONG_SIGNATURE, REPLAYED)


def clock() -> SigningClock:
    return SigningClock(time.time() - time.monotonic())


def signing(device: Any) -> Any:
    """The device with the key: it signs, and hears only what is signed."""
    ours = clock()
    device.sign(Signer(KEY, ours, 3), Verifier(KEY, ours))
    return device


class Attacker:
    """Reads all that reaches the module, and sends whatever bytes it likes."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []
        self._output: list[bytes] = []

    def say(self, *datagrams: bytes) -> None:
        self._output += datagrams

    # -- as the loop wants it -------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Any = None) -> None:
        """The node answers nobody who sends no valid frame."""

    def stream_ended(self, stream: Any) -> None: ...

    def update(self, now: float) -> None: ...

    def next_deadline(self) -> float:
        return math.inf

    def take_output(self) -> list[bytes]:
        output, self._output = self._output, []
        return output

    def take_events(self) -> list[Any]:
        return []


class Overheard(Module):
    """A module on whose wire somebody listens."""

    def __init__(self, attacker: Attacker) -> None:
        super().__init__()
        self._attacker = attacker

    def receive(self, data: bytes, now: float, stream: Any = None) -> None:
        self._attacker.heard.append(data)
        super().receive(data, now, stream)


def deployed(ids: tuple[int, int], signer: Signer | None = None) -> list[bytes]:
    """The frames of one who says that it is the parachute, and is out."""
    encoder = FrameEncoder(*ids, signer)
    status = dialect.MAVLink_parachute_status_message(
        999_999, 0, 0, int(DeploymentTrigger.DRONE), 0, 0, b"2026-01-01"
    )
    kind, autopilot = dialect.MAV_TYPE_PARACHUTE, dialect.MAV_AUTOPILOT_INVALID
    beat = dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3)
    return [encoder.encode(one, time.monotonic()) for one in (beat, status)]


def disarmed(ids: tuple[int, int], signer: Signer | None = None) -> list[bytes]:
    """The frames of one who says that it is the autopilot, that it obeyed, and that it stands."""
    encoder = FrameEncoder(*ids, signer)
    kind, make = dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_PX4
    told = (
        dialect.MAVLink_command_ack_message(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0),
        dialect.MAVLink_heartbeat_message(kind, make, 0, 0, 3, 3),
        dialect.MAVLink_extended_sys_state_message(0, 1),
    )
    return [encoder.encode(one, time.monotonic()) for one in told]


def forgers() -> dict[str, Signer | None]:
    """Reason under which it is dropped -> how a stranger signs."""
    return {UNSIGNED: None, WRONG_SIGNATURE: Signer(OTHER_KEY, clock(), 3)}


class Attacked:
    """The node with its key, module and autopilot that hold it too, and the attacker."""

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench = bench
        self.diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
        self.key_file = bench.folder / "signing.key"
        self.key_file.write_bytes(KEY)
        self.key_file.chmod(0o600)
        self.parameters = {"signing_key_file": str(self.key_file)} | parameters
        self.network = Network(bench, **self.parameters)
        self.attacker = Attacker()
        self.plug_attacker()
        self.module = signing(Overheard(self.attacker))
        self.autopilot = signing(Autopilot())

    def plug_attacker(self) -> None:
        """The node has heard of it."""
        self.attackers_loop = self.network.plug(self.attacker)
        self.attackers_loop.call(lambda link, now: link.say(b"who is there?"))
        self.bench.until(lambda: self.link.counts, "the node has heard of it")

    def restart(self) -> None:
        """The node ends and starts anew."""
        self.bench.remove(self.network.node)
        self.network = Network(self.bench, **self.parameters)
        self.plug_attacker()

    def plug_devices(self) -> None:
        self.modules_loop = self.network.plug(self.module)
        self.autopilots_loop = self.network.plug(self.autopilot)

    def send(self, *datagrams: bytes) -> None:
        """The attacker sends, and the node has read it."""
        before = self.link.counts[NOISE]
        # What it counts of the last one tells that it has read those before.
        self.attackers_loop.call(lambda link, now: link.say(*datagrams, b"!"))
        self.bench.until(lambda: self.link.counts[NOISE] > before, "the node has read it")

    def modules_counts(self) -> Counter[str]:
        """What the module has dropped, by reason, once it has heard the node."""
        decoders = self.module._decoders
        self.bench.until(lambda: None in decoders, "the module has heard something")
        return decoders[None].counts

    @property
    def link(self) -> Any:
        return self.network.node.loop.link

    def counts(self) -> dict[str, int]:
        """How many frames were dropped for their signature, by reason."""
        return {reason: self.link.counts[reason] for reason in REASONS}

    def task(self, name: str) -> Any:
        """The newest status of this task in diagnostics."""
        statuses = [one for array in self.diagnostics for one in array.status]
        return next((one for one in reversed(statuses) if one.name.endswith(f": {name}")), None)


def overheard() -> list[bytes]:
    """True frames of the module, from another of its links."""
    return deployed(CHUTE, Signer(KEY, clock(), 9))


def healthy(attacked: Attacked) -> list[LinkHeartbeat]:
    """The true devices are heard; the heartbeats of the node."""
    beats = attacked.bench.follow(LinkHeartbeat, "safety/heartbeat")
    attacked.plug_devices()
    attacked.bench.until(lambda: beats and beats[-1].device_healthy, "the module is heard")
    return beats
