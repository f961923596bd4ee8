"""A connection string becomes an address, or one line that says what is wrong with it."""

import pytest

from chute_ros.errors import ParameterError
from chute_ros.transport.address import FORMS, Address, parse_address, parse_serial_address
from chute_ros.transport.serial_wire import SerialWire
from chute_ros.transport.tcp import TcpClientWire, TcpServerWire
from chute_ros.transport.udp import UdpWire
from chute_ros.transport.wire import make_wire

BY_PATH = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0"

FORMS_AND_MEANING = {
    "udpin:0.0.0.0:14550": (Address("udpin", "0.0.0.0", 14550), UdpWire),
    "udpin:127.0.0.1:0": (Address("udpin", "127.0.0.1", 0), UdpWire),
    "udpout:10.0.0.2:14550": (Address("udpout", "10.0.0.2", 14550), UdpWire),
    "udppair:127.0.0.1:14541:127.0.0.1:14540": (
        Address("udppair", "127.0.0.1", 14541, "127.0.0.1", 14540),
        UdpWire,
    ),
    "tcp:drone.local:5760": (Address("tcp", "drone.local", 5760), TcpClientWire),
    "tcpin:0.0.0.0:65535": (Address("tcpin", "0.0.0.0", 65535), TcpServerWire),
    "serial:/dev/ttyUSB0": (Address("serial", "/dev/ttyUSB0", 57600), SerialWire),
    "serial:/dev/ttyACM0:921600": (Address("serial", "/dev/ttyACM0", 921600), SerialWire),
    f"serial:{BY_PATH}": (Address("serial", BY_PATH, 57600), SerialWire),
    "usb:c0de:cafe": (Address("usb", "", 0xC0DE, send_port=0xCAFE), SerialWire),
    "usb:0x0403:6001:A10K": (Address("usb", "A10K", 0x0403, send_port=0x6001), SerialWire),
    f"serial:{BY_PATH}:115200": (Address("serial", BY_PATH, 115200), SerialWire),
    "serial:/tmp/tty:rocket:9600": (Address("serial", "/tmp/tty:rocket", 9600), SerialWire),
}


@pytest.mark.parametrize("text", FORMS_AND_MEANING)
def test_every_form_is_understood(text):
    address, wire = FORMS_AND_MEANING[text]
    assert parse_address(text) == address
    assert isinstance(make_wire(address), wire)


def test_the_table_above_covers_every_form_that_is_offered():
    offered = {form.strip().split(":")[0] for form in FORMS.replace(" or ", ",").split(",")}
    tried = {text.split(":")[0] for text in FORMS_AND_MEANING}
    assert offered == tried


@pytest.mark.parametrize(
    "text",
    [
        "",
        "udpin",
        "udpin:",
        "udpin:14550",
        "udpin::14550",
        "udpin:127.0.0.1:",
        "udpin:127.0.0.1:14550:",
        "udpin:::1:14550",
        "udp:127.0.0.1:14550",
        "UDPIN:127.0.0.1:14550",
        "udppair:127.0.0.1:14541",
        "udppair:127.0.0.1:14541:127.0.0.1:",
        "tcp:localhost",
        "serial",
        "serial:",
        "serial::57600",
        "usb",
        "usb:c0de",
        "usb:c0de:",
        "usb:c0deb:cafe",
        "usb:ttyACM0:cafe",
        "serial:/dev/ttyUSB0:",
        "serial:/dev/ttyUSB0:0",
        "/dev/ttyUSB0",
    ],
)
def test_what_is_no_address_is_named_with_what_would_be(text):
    with pytest.raises(ParameterError) as caught:
        parse_address(text)
    assert repr(text) in str(caught.value)
    assert FORMS in str(caught.value)


@pytest.mark.parametrize(
    ("text", "port"),
    [
        ("udpin:127.0.0.1:65536", "65536"),
        ("udpin:127.0.0.1:-1", "-1"),
        ("udpin:127.0.0.1:mavlink", "mavlink"),
        ("udpin:127.0.0.1:1e3", "1e3"),
        ("udpin:127.0.0.1:\u0661\u0662", "\u0661\u0662"),
        ("udpin:127.0.0.1: 14550", " 14550"),
        # Nothing can be sent to port 0.
        ("udpout:127.0.0.1:0", "0"),
        ("tcp:127.0.0.1:0", "0"),
        # Python reads no number of so many digits.
        ("tcp:127.0.0.1:" + "1" * 5000, "1" * 5000),
        ("udppair:127.0.0.1:14541:127.0.0.1:0", "0"),
    ],
)
def test_a_port_that_is_none_is_named_with_its_connection(text, port):
    with pytest.raises(ParameterError) as caught:
        parse_address(text)
    assert f"connection {text!r}: port {port!r}" in str(caught.value)
    assert "to 65535" in str(caught.value)
    assert FORMS in str(caught.value)


@pytest.mark.parametrize("baud", ["abc", "", "0", "-1", "57k6", "9" * 5000, "\u0661"])
def test_a_baud_rate_that_is_none_is_named_with_its_connection(baud):
    text = f"serial:/dev/ttyUSB0:{baud}"
    with pytest.raises(ParameterError) as caught:
        parse_address(text)
    told = f"connection {text!r}: baud rate {baud!r} is no whole number from 1 on, such as 57600"
    assert told in str(caught.value)
    assert FORMS in str(caught.value)


def test_a_path_alone_is_answered_with_what_was_meant():
    for path in ("/dev/ttyUSB0", "/dev/ttyUSB0:57600"):
        for parse in (parse_address, parse_serial_address):
            with pytest.raises(ParameterError, match=rf"; did you mean 'serial:{path}'\?$"):
                parse(path)


@pytest.mark.parametrize("text", ["serial:/dev/ttyACM0", "usb:c0de:cafe:A1"])
def test_where_only_a_serial_port_will_do_its_forms_are_taken(text):
    assert parse_serial_address(text) == parse_address(text)


@pytest.mark.parametrize("text", ["udpin:0.0.0.0:14550", "tcp:host:1", "/dev/ttyACM0", ""])
def test_where_only_a_serial_port_will_do_nothing_else_is(text):
    with pytest.raises(ParameterError, match=r"need serial:PATH\[:BAUD\] or usb:VENDOR:PRODUCT"):
        parse_serial_address(text)
