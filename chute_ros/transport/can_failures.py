"""Meaning of exceptions of python-can and of drivers below it for the wire."""

from __future__ import annotations

import errno
import struct

from serial import SerialException, SerialTimeoutException

#: What the library and its drivers let through of a frame that is none.
_MISFITS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
    struct.error,
)
#: What a full queue is called; all else that the system reports is the end of the interface.
_FULL = (errno.EAGAIN, errno.ENOBUFS, errno.ETIMEDOUT)
_LONGEST_KIND = 60


def bad_frame(error: BaseException) -> str:
    """What to count error as, if it is the fault of one frame; empty: of the interface."""
    # Here, as in can_bus: a bus over mcast does not wait for the import.
    import can

    if isinstance(error, can.CanError):
        if system_error(error) is not None:
            return ""
        return f"bad frames: {str(error).partition(' [')[0][:_LONGEST_KIND]}"
    return f"bad frames: {type(error).__name__}" if isinstance(error, _MISFITS) else ""


def is_full(error: BaseException) -> bool:
    """The transmit queue is full; the interface is there."""
    import can

    cause = system_error(error)
    if isinstance(cause, (TimeoutError, SerialTimeoutException)):
        return True
    if cause is not None:
        return cause.errno in _FULL
    # How socketcan says that it may not be written to.
    return isinstance(error, can.CanOperationError)


def taken_by_another(error: BaseException) -> bool:
    """pyserial found a port that was ready to be read without a byte: unplugged, or read by
    another program as well."""
    cause = system_error(error)
    return isinstance(cause, SerialException) and "readiness to read" in str(cause)


def system_error(error: BaseException) -> OSError | None:
    """The error of the operating system that error is, or comes from."""
    for one in (error.__cause__, error):
        if isinstance(one, OSError):
            return one
    return None


def reason(error: BaseException) -> str:
    """Error in one line, with what it comes from."""
    text = str(error) or type(error).__name__
    if type(error) is NameError:
        # Kvaser's without canlib: its functions are only defined where it was found.
        text = f"the driver's own library is not found: install it ({text})"
    cause = error.__cause__
    whole = f"{text} ({cause})" if cause is not None and str(cause) not in text else text
    return " ".join(whole.split())
