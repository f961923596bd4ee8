"""What libraries log of what strangers send: escaped, on one line each, and not without end."""

from __future__ import annotations

import logging
import time
from collections import deque

from chute_ros.plain_text import plain

#: Lines of all of them together in this time, s; more are left out.
MOST_LINES, WITHIN = 20, 10.0
_LONGEST = 500


class PlainFilter(logging.Filter):
    """Of the lines of several loggers."""

    def __init__(self) -> None:
        super().__init__()
        self._times: deque[float] = deque(maxlen=MOST_LINES)

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it is written; changes it to a plain one, with the error's name for a
        traceback."""
        now = time.monotonic()
        if len(self._times) == MOST_LINES and now < self._times[0] + WITHIN:
            return False
        self._times.append(now)
        text = record.getMessage()
        if record.exc_info and record.exc_info[1] is not None:
            error = record.exc_info[1]
            text = f"{text}: {type(error).__name__}: {error}"
        record.msg, record.args = plain(text)[:_LONGEST], None
        record.exc_info = record.exc_text = None
        return True


def plain_log_of(*names: str) -> None:
    """From now on these loggers write plain lines."""
    one = PlainFilter()
    for name in names:
        logging.getLogger(name).addFilter(one)
