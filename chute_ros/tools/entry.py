"""Starting a tool from the command line: Ctrl-C at every moment, and what cannot be printed, end
it in one line."""

from __future__ import annotations

import contextlib
import errno
import importlib
import os
import signal
import sys
from collections.abc import Callable

from chute_ros.interrupts import CtrlC, at_ctrl_c
from chute_ros.tools.streams import NotPrintedError, flush, give_up_output, set_up_streams

#: The exit code of what a Ctrl-C ended, as shells have it.
INTERRUPTED = 128 + signal.SIGINT
#: Of what could not print: its reader has gone, as shells have it, or another cause. No tool has
#: them for a result.
UNREAD, NOT_PRINTED = 128 + signal.SIGPIPE, os.EX_IOERR
#: Of a link that is not registered as it should be.
_NOT_REGISTERED = 2
_STDERR = 2
#: Tools that leave nothing behind, which therefore may be cut off so long after a Ctrl-C, s.
_ALONE, _CUT_OFF_AFTER = ("chute",), 5.0


def run(name: str, module: str) -> None:
    """Run main of the module of tool name; exit code 130 if Ctrl-C ended it, 141 if
    who read its output has gone, 74 if that takes nothing for another reason, 2 if a link is not
    registered as it should be."""
    set_up_streams()

    def end(*_: object) -> None:
        _tell(name, "interrupted")
        os._exit(INTERRUPTED)

    with at_ctrl_c(end):
        # Here: it takes up to a second.
        main = _main_of(name, module)
    ctrl_c = CtrlC((_CUT_OFF_AFTER, end) if name in _ALONE else None)
    ctrl_c.install()
    try:
        try:
            main()
        except NotPrintedError:
            give_up_output()
            raise
        finally:
            flush()
    except (KeyboardInterrupt, Exception) as error:
        _end_unregistered(name, error)
        if isinstance(error, NotPrintedError) and not ctrl_c.came:
            give_up_output()
            sys.exit(_not_printed(name, error))
        # In the middle of a conversion rclpy's binding makes an error of its own of it.
        if not (ctrl_c.came or isinstance(error, KeyboardInterrupt) or _shut_down(error)):
            raise
        _tell(name, "interrupted")
        sys.exit(INTERRUPTED)
    finally:
        # All is ended; a second Ctrl-C would only tell where in the interpreter it was.
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _main_of(name: str, module: str) -> Callable[[], None]:
    try:
        main: Callable[[], None] = importlib.import_module(f"chute_ros.tools.{module}").main
    except Exception as error:
        _end_unregistered(name, error)
        raise
    return main


def _end_unregistered(name: str, error: BaseException) -> None:
    """In one line, if a link is not registered as it should be: any tool may meet it."""
    # Not at the top: before Ctrl-C is taken care of, as little as can be is imported.
    from chute_ros.errors import NotRegisteredError

    if isinstance(error, NotRegisteredError):
        _tell(name, str(error))
        sys.exit(_NOT_REGISTERED)


def _shut_down(error: BaseException) -> bool:
    """A signal has shut ROS down: a script's background job has no SIGINT but rclpy's own, which
    does it in a thread of its own, before ours is told. Then each call of rclpy fails."""
    if "rclpy.executors" not in sys.modules:
        return False
    rclpy, binding = (sys.modules[name] for name in ("rclpy", "rclpy._rclpy_pybind11"))
    ended = isinstance(error, binding.RCLError) and not rclpy.ok()
    return ended or isinstance(error, sys.modules["rclpy.executors"].ExternalShutdownException)


def _not_printed(name: str, error: NotPrintedError) -> int:
    """The exit code; a reader who has seen enough, as head, is told nothing."""
    if error.instead:
        _tell(name, error.instead)
    if error.errno == errno.EPIPE:
        return UNREAD
    _tell(name, f"standard output cannot be written: {error.strerror}")
    return NOT_PRINTED


def _tell(name: str, text: str) -> None:
    # Past the streams: into what is being printed at this moment nothing can be printed.
    with contextlib.suppress(OSError):
        os.write(_STDERR, f"{name}: {text}\n".encode())
