"""A MAVLink link with all its transactions, driven by a program: frames, time, requests."""

from __future__ import annotations

from typing import Any

from chute_ros.links.mavlink.protocol.config import KillMethod, MavlinkConfig
from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.protocol.mavlink.dialect import FORCE_DISARM
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.signing import Signer, SigningClock, Verifier
from fuzz.program import Program
from fuzz.target import Target, WrongError
from fuzz.targets.linked import Linked
from fuzz.targets.mavlink_frames import COMPONENTS, KEY, SYSTEMS, good_frame

_COMMANDS = (
    d.MAV_CMD_DO_PARACHUTE,
    d.MAV_CMD_SET_PARACHUTE_ARM,
    d.MAV_CMD_DO_FLIGHTTERMINATION,
    d.MAV_CMD_COMPONENT_ARM_DISARM,
    d.MAV_CMD_REQUEST_MESSAGE,
    d.MAV_CMD_SET_MESSAGE_INTERVAL,
)
_DEVICES = ("", "1/161", "2/161", "9/9")


def _heartbeat(p: Program) -> Any:
    autopilot = p.flag()
    kind = d.MAV_TYPE_QUADROTOR if autopilot else d.MAV_TYPE_PARACHUTE
    make = d.MAV_AUTOPILOT_PX4 if autopilot else d.MAV_AUTOPILOT_INVALID
    return d.MAVLink_heartbeat_message(kind, make, p.byte(), 0, p.byte() % 9, 3)


def _status(p: Program) -> Any:
    boot_ms, errors = 5000 + 100 * p.byte(), p.byte()
    return d.MAVLink_parachute_status_message(
        boot_ms, errors, p.byte(), p.byte() % 8, p.byte() % 8, 20, b"2026-01-31"
    )


def _acknowledgement(p: Program) -> Any:
    command, result = p.choice(_COMMANDS), p.byte() % 12
    return d.MAVLink_command_ack_message(command, result, p.byte(), 0, p.byte() % 3, 0)


def _landed(p: Program) -> Any:
    return d.MAVLink_extended_sys_state_message(0, p.byte() % 6)


def _interval(p: Program) -> Any:
    return d.MAVLink_message_interval_message(p.byte(), p.whole(4))


_KINDLY = (_heartbeat, _status, _acknowledgement, _landed, _interval)


class MavlinkLinked(Linked):
    """One link, and what it was asked for."""

    def __init__(self, signed: bool = False) -> None:
        self._clock = SigningClock(1.7e9) if signed else None
        signer = Signer(KEY, self._clock) if self._clock else None
        verifier = Verifier(KEY, self._clock) if self._clock else None
        method = KillMethod.FORCED_DISARM if signed else KillMethod.FLIGHT_TERMINATION
        super().__init__(MavlinkLink(MavlinkConfig(kill_method=method), signer, verifier))
        self._ear = FrameDecoder()
        self._encoders: dict[tuple[int, int], FrameEncoder] = {}
        #: Flight was blocked since what left was looked at last.
        self._blocked = False
        #: A deploy was ordered at some time.
        self._deployed = False
        self._steps = (
            self._wait,
            self._to_next_deadline,
            self._kindly,
            self._kindly,
            self._frame,
            self._bytes,
            self._deploy,
            self._kill,
            self._arm,
            self._action,
            self._message,
            self._interval,
            self._block,
            self._owner,
        )

    # -- steps of a program ----------------------------------------------------------------------

    def _to_next_deadline(self, p: Program) -> None:
        deadline = self._link.next_deadline()
        self._now = max(self._now, deadline) if deadline < 1e9 else self._now

    def _kindly(self, p: Program) -> None:
        message = p.choice(_KINDLY)(p)
        ids = (p.choice(SYSTEMS[:2]), p.choice(COMPONENTS))
        if ids not in self._encoders:
            # Each sender signs on a link of its own.
            signer = Signer(KEY, self._clock, len(self._encoders)) if self._clock else None
            self._encoders[ids] = FrameEncoder(*ids, signer)
        self._link.receive(self._encoders[ids].encode(message, self._now), self._now)

    def _frame(self, p: Program) -> None:
        self._link.receive(good_frame(p, self._clock, self._now)[0], self._now)

    def _bytes(self, p: Program) -> None:
        stream = p.choice((None, "a", "b"))
        if p.byte() == 1:
            self._link.stream_ended(stream)
        self._link.receive(p.piece(), self._now, stream)

    def _deploy(self, p: Program) -> None:
        force = p.flag()
        token = self._orders.begin("forced deploy" if force else "deploy")
        self._deployed = True
        self._link.deploy(token, force, self._now, p.choice(_DEVICES))

    def _kill(self, p: Program) -> None:
        self._link.kill(self._orders.begin("kill"), self._now)

    def _arm(self, p: Program) -> None:
        token = self._orders.begin("arm")
        if p.flag():
            self._link.arm(token, p.flag(), p.byte(), self._now)
        else:
            arm, select = p.whole(p.byte() % 5), p.whole(p.byte() % 5)
            self._link.set_triggers(token, arm, select, p.choice(_DEVICES), self._now)

    def _action(self, p: Program) -> None:
        action = p.byte() % 4
        token = self._orders.begin("deploy" if action == d.PARACHUTE_RELEASE else "action")
        self._deployed = self._deployed or action == d.PARACHUTE_RELEASE
        self._link.parachute_action(token, action, p.choice(_DEVICES), self._now)

    def _message(self, p: Program) -> None:
        token = self._orders.begin("message")
        self._link.request_message(token, p.whole(3) & 0xFFFFFF, p.choice(_DEVICES), self._now)

    def _interval(self, p: Program) -> None:
        token, device = self._orders.begin("interval"), p.choice(_DEVICES)
        self._link.set_message_interval(token, p.byte(), p.whole(4), device, self._now)

    def _block(self, p: Program) -> None:
        blocked = p.flag()
        self._blocked = self._blocked or blocked
        self._link.flight_block("a reason" if blocked else "", self._now)

    # -- what comes of it ------------------------------------------------------------------------

    def _run_out(self) -> None:
        self._link.flight_block("", self._now)
        super()._run_out()

    def _turn(self, now: float) -> None:
        super()._turn(now)
        self._link.vehicle_state(now)
        self._link.doubts(self._now)

    def _left(self, raw: bytes) -> None:
        frames = self._ear.feed_datagram(raw, self._now)
        if len(frames) != 1:
            raise WrongError(f"what left is no frame: {raw.hex()}")
        message = frames[0].message
        if message.get_type() in ("HEARTBEAT", "STATUSTEXT"):
            return
        if message.get_type() in ("PARAM_REQUEST_READ", "COMMAND_ACK") and message.target_system:
            return  # the autopilot's settings, and its question whether it may arm
        asks = message.get_type() == "TIMESYNC" and message.tc1 == 0
        if asks and abs(self._now - message.ts1 / 1e9) < 1e-3:
            return  # how long it takes to answer
        if message.get_type() != "COMMAND_LONG" or message.command not in _COMMANDS:
            raise WrongError(f"this left the link: {message}")
        if not message.target_system:
            raise WrongError(f"a command to every vehicle left the link: {message}")
        by = self._allowed_by(message)
        if by:
            self._orders.left(str(message), by)

    def _allowed_by(self, message: Any) -> tuple[str, ...]:
        """The orders of which one must stand for this command; none: it may always be sent."""
        number, first, second = message.command, message.param1, message.param2
        if number == d.MAV_CMD_DO_PARACHUTE:
            fires = first == d.PARACHUTE_RELEASE
            return ("deploy", "forced deploy") if fires else ("action",)
        if number == d.MAV_CMD_SET_PARACHUTE_ARM:
            return ("arm", "forced deploy")
        if number == d.MAV_CMD_DO_FLIGHTTERMINATION:
            self._check_release(message)
            return ("kill",)
        if second == FORCE_DISARM and not self._blocked:
            return ("kill",)
        if number == d.MAV_CMD_COMPONENT_ARM_DISARM and (first != 0.0 or not self._blocked):
            raise WrongError(f"nobody had blocked flight, or it arms: {message}")
        return ()

    def _check_release(self, message: Any) -> None:
        """What may release a parachute as it terminates is terminated only beside a deploy."""
        autopilot = self._link.autopilots.get(message.target_system, message.target_component)
        known = autopilot is not None and autopilot.settings.firmware is Firmware.ARDUPILOT
        if not known and not self._deployed:
            raise WrongError(f"a kill alone may release: {message}")


#: Two devices with one id are told apart by so many of the newest messages (protocol/twins.py).
_LARGER = dict.fromkeys(("Twins._seen", "Twins._sights", "Twins._copies"), 1000)
TARGETS = (
    Target(
        "mavlink.link",
        "the link with its transactions",
        MavlinkLinked,
        longest=512,
        larger=_LARGER,
    ),
    Target(
        "mavlink.link_signed",
        "the same with a key",
        lambda: MavlinkLinked(signed=True),
        longest=512,
        larger=_LARGER,
    ),
)
