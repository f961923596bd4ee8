"""Address of a byte wire, in one string.

udpin:HOST:PORT                        listen; answer everyone whose frames were heard there
udpout:HOST:PORT                       send there; listen to what comes back
udppair:HOST:PORT:HOST:PORT            two one-way sockets: listen on the first, send to the second
tcp:HOST:PORT    tcpin:HOST:PORT       connect; accept connections
serial:PATH[:BAUD]                     a serial port, 57600 baud if not said
usb:VENDOR:PRODUCT[:SERIAL]            a serial port by its USB ids, hexadecimal
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from chute_ros.errors import ParameterError

FORMS = (
    "udpin:HOST:PORT, udpout:HOST:PORT, udppair:HOST:PORT:HOST:PORT, tcp:HOST:PORT, "
    "tcpin:HOST:PORT, serial:PATH[:BAUD] or usb:VENDOR:PRODUCT[:SERIAL]"
)
SERIAL_FORMS = "serial:PATH[:BAUD] or usb:VENDOR:PRODUCT[:SERIAL]"
DEFAULT_BAUD = 57600
#: Names there, above all under by-path, hold colons of their own.
_COLONS_IN_NAMES = "/dev/serial/"
_USB_ID = re.compile(r"(?:0[xX])?[0-9a-fA-F]{1,4}")
_LISTENING = ("udpin", "tcpin")
_PARTS = {"udpin": 2, "udpout": 2, "udppair": 4, "tcp": 2, "tcpin": 2}


@dataclass(frozen=True)
class Address:
    """A parsed connection string. For serial: host is the path and port the baud rate; for usb:
    host is the serial number (empty: any), port the vendor's id and send_port the product's."""

    kind: str
    host: str
    port: int
    send_host: str = ""
    send_port: int = 0


def _is_whole(text: str) -> bool:
    """A number of digits alone; Python reads none of thousands of them."""
    return text.isascii() and text.isdigit() and len(text) < 10


def _port(text: str, whole: str, lowest: int) -> int:
    if _is_whole(text) and lowest <= int(text) <= 65535:
        return int(text)
    raise ParameterError(
        f"connection {whole!r}: port {text!r} is no number from {lowest} to 65535: need {FORMS}"
    )


def parse_address(text: str) -> Address:
    """The address in text; ParameterError with the allowed forms if it is none."""
    kind, colon, rest = text.partition(":")
    if kind == "serial" and rest:
        return _serial(rest, text)
    if kind == "usb":
        return _usb(rest, text)
    parts = rest.split(":") if colon else []
    if kind not in _PARTS or len(parts) != _PARTS[kind] or not all(parts):
        told = f"connection {text!r} is not understood: need {FORMS}"
        raise ParameterError(told + _meant(text))
    if kind == "udppair":
        host, port, send_host, send_port = parts
        return Address(kind, host, _port(port, text, 0), send_host, _port(send_port, text, 1))
    # Port 0 lets the system choose one to listen on; nothing can be sent to it.
    return Address(kind, parts[0], _port(parts[1], text, 0 if kind in _LISTENING else 1))


def parse_serial_address(text: str) -> Address:
    """The same for what must be a serial port."""
    kind = text.partition(":")[0]
    if kind not in ("serial", "usb"):
        told = f"connection {text!r} is no serial port: need {SERIAL_FORMS}"
        raise ParameterError(told + _meant(text))
    return parse_address(text)


def _meant(text: str) -> str:
    """What a path alone should have been."""
    return f"; did you mean {f'serial:{text}'!r}?" if text.startswith("/") else ""


def _serial(rest: str, whole: str) -> Address:
    path, colon, baud = rest.rpartition(":")
    if not colon or (baud and not _is_whole(baud) and path.startswith(_COLONS_IN_NAMES)):
        path, baud = rest, str(DEFAULT_BAUD)
    if not path:
        raise ParameterError(f"connection {whole!r} names no port: need {FORMS}")
    if not _is_whole(baud) or not int(baud):
        raise ParameterError(
            f"connection {whole!r}: baud rate {baud!r} is no whole number from 1 on, such as "
            f"{DEFAULT_BAUD} (a path with a colon of its own needs it as well): need {FORMS}"
        )
    return Address("serial", path, int(baud))


def _usb(rest: str, whole: str) -> Address:
    vendor, _, more = rest.partition(":")
    product, colon, serial_number = more.partition(":")
    if not _USB_ID.fullmatch(vendor) or not _USB_ID.fullmatch(product) or (colon and not more):
        raise ParameterError(
            f"connection {whole!r}: USB ids are hexadecimal, for example usb:c0de:cafe (lsusb "
            f"shows them): need {FORMS}"
        )
    return Address("usb", serial_number, int(vendor, 16), send_port=int(product, 16))
