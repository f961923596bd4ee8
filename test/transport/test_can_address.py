"""A CAN connection string becomes an address, or one line that says what is wrong with it."""

import subprocess
import sys

import pytest

from chute_ros.errors import ParameterError
from chute_ros.transport.can_address import CAN_FORMS, CanAddress, parse_can_address
from chute_ros.transport.can_bus import CanBusWire
from chute_ros.transport.can_multicast import CanMulticastWire
from chute_ros.transport.can_wire import make_can_wire

BY_PATH = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0"
IPV6_GROUP = "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173"

FORMS_AND_MEANING = {
    "mcast:0": (CanAddress("mcast", "0", 57732), "mcast:0:57732"),
    "mcast:255": (CanAddress("mcast", "255", 57732), "mcast:255:57732"),
    "mcast:7:14700": (CanAddress("mcast", "7", 14700), "mcast:7:14700"),
    "mcast:007:065535": (CanAddress("mcast", "7", 65535), "mcast:7:65535"),
    "socketcan:can0": (CanAddress("socketcan", "can0"), "socketcan:can0"),
    "slcan:/dev/ttyACM0": (CanAddress("slcan", "/dev/ttyACM0"), "slcan:/dev/ttyACM0"),
    "slcan:/dev/ttyUSB0@921600": (
        CanAddress("slcan", "/dev/ttyUSB0@921600"),
        "slcan:/dev/ttyUSB0@921600",
    ),
    f"slcan:{BY_PATH}": (CanAddress("slcan", BY_PATH), f"slcan:{BY_PATH}"),
    "pcan:PCAN_USBBUS1": (CanAddress("pcan", "PCAN_USBBUS1"), "pcan:PCAN_USBBUS1"),
    "udp_multicast:239.74.163.2": (
        CanAddress("udp_multicast", "239.74.163.2", 43113),
        "udp_multicast:239.74.163.2:43113",
    ),
    "udp_multicast:239.74.163.2:5000": (
        CanAddress("udp_multicast", "239.74.163.2", 5000),
        "udp_multicast:239.74.163.2:5000",
    ),
    f"udp_multicast:{IPV6_GROUP}": (
        CanAddress("udp_multicast", IPV6_GROUP, 43113),
        f"udp_multicast:{IPV6_GROUP}",
    ),
}


@pytest.mark.parametrize("text", FORMS_AND_MEANING)
def test_every_form_is_understood_and_described_so_that_it_is_understood_again(text):
    address, description = FORMS_AND_MEANING[text]
    assert parse_can_address(text) == address
    wire = make_can_wire(address)
    assert isinstance(wire, CanMulticastWire if address.interface == "mcast" else CanBusWire)
    assert wire.describe() == description
    assert parse_can_address(description) == address
    assert not wire.is_open
    assert wire.files() == []


def test_the_bitrate_is_part_of_the_address():
    address = parse_can_address("socketcan:can0", 1_000_000)
    assert address == CanAddress("socketcan", "can0", 0, 1_000_000)
    assert make_can_wire(address).describe() == "socketcan:can0 at 1000000 bit/s"
    with pytest.raises(ParameterError, match="bitrate -1 is no number of bit/s: need 0 or more"):
        parse_can_address("socketcan:can0", -1)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "is not understood"),
        ("mcast", "is not understood"),
        ("mcast:", "is not understood"),
        (":can0", "is not understood"),
        ("can0", "is not understood"),
        ("socketcan:", "is not understood"),
        ("mcast::57732", "bus '' is no number from 0 to 255"),
        ("mcast:256", "bus '256' is no number from 0 to 255"),
        ("mcast:-1", "bus '-1' is no number"),
        ("mcast:\u0661", "bus '\u0661' is no number"),
        ("mcast:" + "9" * 5000, "is no number"),
        ("mcast:can0", "bus 'can0' is no number"),
        ("mcast:0:", "port '' is no number from 0 to 65535"),
        ("mcast:0:65536", "port '65536' is no number from 0 to 65535"),
        ("mcast:0:1:2", "port '1:2' is no number"),
        ("mcast:0:0", "nothing can be sent to port 0"),
        ("MCAST:0", "'MCAST' is no interface: need mcast or one of"),
        ("udpin:127.0.0.1:14550", "'udpin' is no interface"),
        ("udp_multicast:127.0.0.1", "'127.0.0.1' is no multicast address"),
        ("udp_multicast:127.0.0.1:43113", "'127.0.0.1:43113' is no multicast address"),
        ("udp_multicast:239.74.163.2:", "port '' is no number"),
        ("udp_multicast:239.74.163.2:0", "nothing can be sent to port 0"),
        (f"udp_multicast:{IPV6_GROUP}:43113", "is no multicast address"),
    ],
)
def test_what_is_no_address_is_named_with_what_would_be(text, why):
    with pytest.raises(ParameterError) as caught:
        parse_can_address(text)
    assert f"connection {text!r}" in str(caught.value)
    assert why in str(caught.value)
    assert CAN_FORMS in str(caught.value)


def test_the_interfaces_that_may_be_used_are_listed():
    with pytest.raises(ParameterError, match=r"kvaser.*pcan.*slcan.*socketcan.*udp_multicast"):
        parse_can_address("can:can0")


def test_a_bus_over_mcast_does_not_wait_for_the_library_of_the_other_interfaces():
    script = (
        "import sys\n"
        "from chute_ros.transport.can_address import parse_can_address\n"
        "from chute_ros.transport.can_wire import make_can_wire\n"
        "wire = make_can_wire(parse_can_address('mcast:0:14700'))\n"
        "wire.open()\n"
        "wire.close()\n"
        "assert 'can' not in sys.modules\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
