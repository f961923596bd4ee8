"""Tells timed stories to a MavlinkLink over bytes: what devices send, what comes out."""

import struct
from typing import Any

from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.protocol.events import Notice, ParachuteChanged, RequestFinished
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder

START = 1000.0
ASLEEP = {"autopilot_message_rate": 0.0}


def heartbeat(
    kind=d.MAV_TYPE_PARACHUTE, autopilot=d.MAV_AUTOPILOT_INVALID, mode=0, state=d.MAV_STATE_ACTIVE
):
    """A HEARTBEAT; by default a healthy parachute's."""
    return d.MAVLink_heartbeat_message(kind, autopilot, mode, 0, state, 3)


def copter(armed=False, state=d.MAV_STATE_ACTIVE):
    """An autopilot's HEARTBEAT."""
    mode = d.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return heartbeat(d.MAV_TYPE_QUADROTOR, d.MAV_AUTOPILOT_PX4, mode, state)


def ardupilot(armed=False, state=d.MAV_STATE_ACTIVE, kind=d.MAV_TYPE_QUADROTOR):
    """An ArduPilot's HEARTBEAT."""
    mode = d.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return heartbeat(kind, d.MAV_AUTOPILOT_ARDUPILOTMEGA, mode, state)


def setting(name, value, kind=d.MAV_PARAM_TYPE_REAL32):
    """A PARAM_VALUE as ArduPilot sends it, and PX4 a float."""
    return d.MAVLink_param_value_message(name.encode(), value, kind, 1000, 0xFFFF)


def px4_integer(name, value):
    """A PARAM_VALUE as PX4 sends an integer: its bytes in the float."""
    (as_float,) = struct.unpack("<f", struct.pack("<i", value))
    return setting(name, as_float, d.MAV_PARAM_TYPE_INT32)


def no_setting(name):
    """A PARAM_ERROR: there is no such parameter."""
    missing = d.MAV_PARAM_ERROR_DOES_NOT_EXIST
    return d.MAVLink_param_error_message(255, 0, name.encode(), -1, missing)


def landed(state=d.MAV_LANDED_STATE_ON_GROUND):
    """An EXTENDED_SYS_STATE."""
    return d.MAVLink_extended_sys_state_message(0, state)


def status(boot_ms=5000, errors=0, armed=0, deployed=0, safety=0, ats=20, packed=b"2026-01-31"):
    """A PARACHUTE_STATUS."""
    return d.MAVLink_parachute_status_message(
        boot_ms, errors, armed, deployed, safety, ats, packed
    )


def ack(command, result=d.MAV_RESULT_ACCEPTED, target=(0, 0)):
    """A COMMAND_ACK."""
    return d.MAVLink_command_ack_message(command, result, 255, 0, *target)


class Bench:
    """One link; t is seconds since the start of the story."""

    def __init__(self, signer=None, verifier=None, **config):
        self.link = MavlinkLink(MavlinkConfig(**{**ASLEEP, **config}), signer, verifier)
        self.t = 0.0
        self.sent: list[tuple[float, Any]] = []
        self.events: list[Any] = []
        self._senders: dict[tuple[int, int], FrameEncoder] = {}
        self._decoder = FrameDecoder()

    @property
    def now(self):
        return START + self.t

    def encoder(self, ids):
        return self._senders.setdefault(ids, FrameEncoder(*ids))

    def at(self, t):
        """Go to t, waking at each deadline on the way."""
        assert t >= self.t
        for _ in range(10_000):
            wake = self.link.next_deadline() - START
            if wake > t:
                break
            self.t = max(wake, self.t)
            self._update()
        else:
            raise AssertionError("the link wants to be woken without end")
        self.t = t
        self._update()
        return self

    def hear(self, ids, *messages):
        """These messages come from ids, each in a datagram."""
        for message in messages:
            self.link.receive(self.encoder(ids).encode(message, self.now), self.now)
        self._update()
        return self

    def stream(self, until, every, ids, *makes):
        """What each of makes makes comes from ids again and again."""
        while self.t + every <= until + 1e-9:
            self.at(self.t + every).hear(ids, *(make() for make in makes))
        return self

    def _update(self):
        self.link.update(self.now)
        self.collect()

    def call(self, what, *arguments):
        """Call this method of the link now; what it sends at once has left."""
        getattr(self.link, what)(*arguments, self.now)
        return self.collect()

    def collect(self):
        for raw in self.link.take_output():
            frames = self._decoder.feed_datagram(raw, self.now)
            assert len(frames) == 1
            self.sent.append((self.t, frames[0].message))
        self.events += self.link.take_events()
        return self

    # -- what came out -------------------------------------------------------------------------

    def commands(self, number=None):
        """The COMMAND_LONGs sent so far."""
        longs = [m for _, m in self.sent if m.get_type() == "COMMAND_LONG"]
        return [m for m in longs if number in (None, m.command)]

    def reads(self):
        """The PARAM_REQUEST_READs sent so far."""
        return [m for _, m in self.sent if m.get_type() == "PARAM_REQUEST_READ"]

    def clear(self):
        self.sent.clear()
        self.events.clear()
        return self

    def ends(self, token):
        return [
            e for e in self.events if isinstance(e, RequestFinished) and e.finished.token == token
        ]

    def end(self, token):
        """How the request ended; exactly once."""
        (end,) = self.ends(token)
        return end

    def notices(self):
        return [e.text for e in self.events if isinstance(e, Notice)]

    def last_status(self):
        return [e.status for e in self.events if isinstance(e, ParachuteChanged)][-1]

    def texts(self):
        """What a ground station reads."""
        whole = []
        for message in (m for _, m in self.sent if m.get_type() == "STATUSTEXT"):
            if message.chunk_seq == 0:
                whole.append("")
            whole[-1] += message.text
        return whole
