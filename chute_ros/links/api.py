"""What a link is. Read this before you write one.

A link is how one kind of device is spoken to. Everything of it is in one folder:

    protocol/       pure: bytes and time in, bytes and events out; its link object is a Link
    runtime.py      pure: when the device is healthy, and what a decision becomes
                    (a subclass of chute_ros.runtime.device.DeviceRuntime)
    node.py         the ROS node (a subclass of chute_ros.ros.device_node.DeviceNode)
    parameters.py   the settings of the node (chute_ros/settings.py), each parameter written once
    __main__.py     starts the node
    simulator/      the simulated device, where there is one
    conformance/    pure: the clauses of its document, for whoever builds such a device; kit.py
                    what the command `conformance` takes of them
    virtual.py      its node and its simulated device in a flight of the campaign (a CampaignPart)
    __init__.py     LINK, a LinkKind: how launch files, parameter tables, the campaign, the device
                    suite and the docs find all that

and it is registered by one entry of the entry point group `chute_ros.links`, which any package may
have: `NODE = PACKAGE.MODULE:LINK` (docs/design/links.md). Its node, vehicles, launch argument and
device have names that no other link has, nor a launch file of ours: else nothing starts
(NotRegisteredError).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from chute_ros.errors import NotBuiltError, NotRegisteredError
from chute_ros.settings import Value

#: The node that speaks to the autopilot, also where the parachute is on another link.
AUTOPILOT_LINK = "mavlink_parachute"
SUPERVISOR = "safety_supervisor"
#: A text that names an object: "package.module:attribute".
Place = str


class Link(Protocol):
    """The pure protocol object of one device. Times are monotonic s. No method raises for what
    came from the wire. It is fed by transport/loop.py, and by the campaign in virtual time."""

    def receive(self, data: bytes, now: float, stream: Any = None) -> None:
        """Take in bytes that came on this stream."""

    def stream_ended(self, stream: Any) -> None:
        """Forget what is half received on a stream that was closed; None: on all."""

    def update(self, now: float) -> None:
        """Do what is due."""

    def next_deadline(self) -> float:
        """Return when update has something to do; infinity: never."""

    def take_output(self) -> list[bytes]:
        """Return the frames to send, each once."""

    def take_events(self) -> list[Any]:
        """Return what happened (protocol/events.py), each once."""

    def owner_alive(self, until: float) -> None:
        """The node is alive: what says so on the wire may go on until then."""

    def has_parachute(self) -> bool:
        """Return whether there is something that a deploy could be sent to."""

    def arm(self, token: int, arm: bool, triggers: int, now: float) -> None:
        """Begin to arm or disarm; ends with a RequestFinished of this token."""

    def deploy(self, token: int, force: bool, now: float) -> None:
        """Begin to release; ends with a RequestFinished of this token."""


class CampaignPart(Protocol):
    """What the campaign has of a link: its node and its simulated device in virtual time."""

    def ways(self, vehicle: VehicleKind) -> tuple[str, ...]:
        """Return the ways that a fault can lie on: of the devices and of the node."""

    def stopping(self, vehicle: VehicleKind) -> tuple[str, ...]:
        """Return the devices that may lose their power."""

    def read(self) -> None:
        """Read what all flights share, before processes part."""

    def join(self, rig: Any) -> None:
        """Plug devices and node into a flight (campaign/rig.py)."""


@dataclass(frozen=True)
class ConnectionArgument:
    """An argument of vehicle.launch.py that overrides the parameter `connection` of a link. No
    other link has it, nor vehicle.launch.py or simulation.launch.py itself."""

    name: str
    description: str


@dataclass(frozen=True)
class Sockets:
    """What the simulators of one vehicle speak over, all on this host. network: where the MAVLink
    node listens, air: where the vehicle's motion is felt, as HOST:PORT; bus: of CAN; terminal: a
    path for a pseudo terminal."""

    network: str
    air: str
    bus: str
    terminal: str


@dataclass(frozen=True)
class VehicleKind:
    """A vehicle that the launch files, config/ and the campaign know by its name.

    name: no other link's. links: its device nodes, in the order in which they are started.
    parameters: of these nodes and the supervisor, node -> what differs from the defaults. rig:
    where the campaign has its kind of flight, if it is no aircraft. often: how many of the
    campaign's flights it flies, beside the others' numbers; or, where it replaces another, it
    flies one in so many of that one's.
    """

    name: str
    description: str
    links: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, Value]]
    often: int
    rig: Place = ""
    replaces: str = ""

    def given(self, node: str, name: str, default: Value) -> Value:
        """Return the value of a node's parameter."""
        return self.parameters.get(node, {}).get(name, default)

    def supervised(
        self, name: str, default: tuple[str, ...] = (AUTOPILOT_LINK,)
    ) -> tuple[str, ...]:
        """Return the texts in this parameter of its supervisor."""
        texts = self.given(SUPERVISOR, name, list(default))
        assert isinstance(texts, list)
        return tuple(texts)


@dataclass(frozen=True)
class LinkKind:
    """One kind of link, and where its parts are. Places are imported when they are needed: the
    campaign runs without ROS.

    name: of the node and of its executable. node: its class; __main__.py is beside its module.
    vehicles: those that carry its device. simulators: command lines for one vehicle, each
    begins with an executable and takes `--control PATH` besides. connection: where the node finds
    what they simulate. part: empty where the campaign does not fly it.
    """

    name: str
    description: str
    node: Place
    parameters: Place
    argument: ConnectionArgument
    vehicles: tuple[VehicleKind, ...]
    simulators: Callable[[VehicleKind, Sockets], tuple[tuple[str, ...], ...]]
    connection: Callable[[Sockets], str]
    part: Place = ""
    #: Name of its device for `conformance`, and its Kit (conformance/kit.py); empty: it has none.
    device: str = ""
    kit: Place = ""
    #: The ROS package that its executables are in.
    package: str = "chute_ros"
    #: False: the supervisor does not start with it in kill_links.
    stops_motors: bool = True


def load(place: Place) -> Any:
    """Return the object at a place. NotRegisteredError: it is not there."""
    module, _, attribute = place.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except NotBuiltError:
        raise
    except (ImportError, AttributeError) as error:
        raise NotRegisteredError(
            f"{place}, which a link names, cannot be imported: {error}: correct the place in its "
            "LinkKind, or install what it needs"
        ) from error
