"""What an exception of python-can means: a bad frame, a full queue, or no interface any more."""

import errno

import can
import pytest
from serial import SerialException, SerialTimeoutException

from chute_ros.transport.can_failures import bad_frame, is_full, reason


def caused(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "full"),
    [
        (can.CanOperationError("Transmit buffer full"), True),
        (caused(can.CanOperationError("x"), OSError(errno.ENOBUFS, "no buffer")), True),
        (caused(can.CanOperationError("x"), BlockingIOError(errno.EAGAIN, "again")), True),
        (caused(can.CanOperationError("x"), SerialTimeoutException("Write timeout")), True),
        (can.CanTimeoutError("x"), True),
        (TimeoutError(), True),
        (caused(can.CanOperationError("x"), OSError(errno.ENETDOWN, "down")), False),
        (caused(can.CanOperationError("x"), OSError(errno.ENXIO, "gone")), False),
        (caused(can.CanOperationError("x"), SerialException("gone")), False),
        (OSError(errno.ENODEV, "gone"), False),
        (RuntimeError("whatever a driver raises"), False),
    ],
)
def test_a_full_queue_is_told_from_an_interface_that_is_gone(error, full):
    assert is_full(error) == full


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (can.CanOperationError("CRC failed"), "bad frames: CRC failed"),
        (can.CanOperationError("CRC failed", 7), "bad frames: CRC failed"),
        (ValueError("'ZZ' is no number"), "bad frames: ValueError"),
        (caused(can.CanOperationError("x"), OSError(errno.ENETDOWN, "down")), ""),
        (OSError(errno.EIO, "gone"), ""),
        (RuntimeError("whatever a driver raises"), ""),
    ],
)
def test_a_bad_frame_is_told_from_an_interface_that_is_gone(error, kind):
    assert bad_frame(error) == kind


def test_a_driver_without_its_library_is_told_in_words():
    """As python-can's Kvaser interface fails where canlib is not installed."""
    told = reason(NameError("name 'canGetNumberOfChannels' is not defined"))
    assert told.startswith("the driver's own library is not found: install it (name 'canGet")
    assert reason(ValueError("CRC")) == "CRC"
