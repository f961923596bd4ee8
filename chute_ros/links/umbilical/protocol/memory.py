"""Long works of the flight computer's memory: dumps and wipes, during which telemetry pauses.

    asked --token sent--> sent --first sign--> begun --end--> over
              each with its own limit of silence

One at a time. One that somebody else began is followed as well, so that its pause of the telemetry
is not taken for a lost link.

Source: Umbilical Reference, sections 2 (Diagnostics & Storage) and 3 ("when not interrupted").
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace

from chute_ros.links.umbilical.protocol import events
from chute_ros.links.umbilical.protocol.config import MemoryLimits
from chute_ros.links.umbilical.protocol.line_parser import (
    MemoryText,
    WipeBegan,
    WipeEnded,
    WipeProgress,
)
from chute_ros.links.umbilical.protocol.scheduler import Command
from chute_ros.links.umbilical.protocol.stream import DumpBegan, DumpBytes, DumpEnded
from chute_ros.model import Outcome
from chute_ros.protocol.events import EventLog, RequestReport, Severity, ended
from chute_ros.protocol.goal import Report
from chute_ros.transitions import after

#: A progress of a dump is told each so many bytes.
_TELL_EACH = 256 * 1024
#: A dump that nobody of ours asked for is followed at most each so many seconds.
_UNASKED_EACH = 5.0


class WorkStep(enum.Enum):
    """How far a work is."""

    ASKED = "waiting for its turn on the wire"
    SENT = "sent, no sign of it yet"
    BEGUN = "in progress"


class WorkEvent(enum.Enum):
    """What moves it on."""

    TOKEN_SENT = "its token was sent"
    FIRST_SIGN = "the flight computer has begun"


STEPS: dict[tuple[WorkStep, WorkEvent], WorkStep] = {
    (WorkStep.ASKED, WorkEvent.TOKEN_SENT): WorkStep.SENT,
    (WorkStep.ASKED, WorkEvent.FIRST_SIGN): WorkStep.BEGUN,
    (WorkStep.SENT, WorkEvent.FIRST_SIGN): WorkStep.BEGUN,
    (WorkStep.BEGUN, WorkEvent.TOKEN_SENT): WorkStep.BEGUN,
    (WorkStep.BEGUN, WorkEvent.FIRST_SIGN): WorkStep.BEGUN,
}


@dataclass(frozen=True)
class Work:
    """One dump or wipe. token 0: nobody of ours asked. last: the newest sign of it, s."""

    name: str
    token: int
    step: WorkStep
    last: float
    size: int = 0
    told: int = 0
    is_wiped: bool = False
    sent: bool = False

    @property
    def is_dump(self) -> bool:
        """It brings bytes."""
        return self.name.startswith("dump")

    @property
    def text(self) -> str:
        """For a person."""
        return self.name.replace("_", " ")


class MemoryWorks(EventLog):
    """Follows the work under way; its requests end in one RequestFinished each."""

    def __init__(self, limits: MemoryLimits) -> None:
        super().__init__()
        self._limits = limits
        self.work: Work | None = None
        self._unasked_until = -math.inf

    # -- asked for -------------------------------------------------------------------------------

    def begin(self, token: int, name: str, now: float) -> str:
        """Ask for a work; the reason why not, or empty."""
        if self.work is not None:
            return f"{name} refused: a {self.work.text} is {self.work.step.value}"
        self.work = Work(name, token, WorkStep.ASKED, now)
        return ""

    def waits_for(self, command: Command) -> bool:
        """Whether the work under way is one of ours that still waits for this token to leave."""
        work = self.work
        return bool(work and work.token and not work.sent and work.name == command.name)

    def token_sent(self, command: Command, now: float) -> None:
        """A token was written: is it this work's?"""
        work = self.work
        if work is not None and self.waits_for(command):
            self.work = replace(
                work, step=after(STEPS, work.step, WorkEvent.TOKEN_SENT), last=now, sent=True
            )
            report = Report(work.token, Outcome.SENT, f"{work.name} sent")
            self._events.append(RequestReport(report))

    # -- what the flight computer says of it -----------------------------------------------------

    @property
    def pause(self) -> str:
        """Why there is no telemetry now, in words; empty: there should be some."""
        work = self.work
        if work is None or work.step is WorkStep.ASKED:
            return ""
        return f"{work.text} {work.step.value}"

    def heard(self, said: object, now: float) -> None:
        """Something of a dump or of a wipe was said."""
        if isinstance(said, DumpBegan):
            if self.work is None and now < self._unasked_until:
                return  # somebody asks for dumps without end, or the wire is noise
            if self.work is None:
                self._unasked_until = now + _UNASKED_EACH
            self._sign("dump_flash", now, f".{said.format.value}")
        elif isinstance(said, DumpBytes):
            self._bytes(said.data, now)
        elif isinstance(said, DumpEnded) and self.work is not None:
            why = "" if said.complete else "no end mark before telemetry resumed"
            self._end(said.complete, why)
        elif isinstance(said, MemoryText):
            self._memory_text(said.text, now)
        elif isinstance(said, WipeBegan):
            self._sign(self._wipe_name(), now)
            self.notice(Severity.INFO, "the flash is being wiped")
        elif isinstance(said, WipeProgress):
            self._sign(self._wipe_name(), now)
            text = f"wiping the flash: {said.done} of {said.total} sectors"
            self._events.append(events.WorkProgress(text, said.done, said.total))
        elif isinstance(said, WipeEnded):
            self._wipe_ended(said, now)

    def telemetry(self, now: float) -> None:
        """A record came: what pauses the telemetry is over."""
        work = self.work
        if work is None or work.step is not WorkStep.BEGUN:
            return
        if work.name == "dump_fram":
            self._end(True, "")
        elif not work.is_dump and not work.is_wiped:
            self._end(False, "telemetry resumed, but its end was not reported")

    def restarted(self) -> None:
        """The flight computer started anew."""
        work = self.work
        if work is not None and work.step is not WorkStep.ASKED:
            wanted = work.name == "wipe_fram_and_reboot"
            self._end(wanted, "" if wanted else "the flight computer restarted")

    def update(self, now: float) -> bool:
        """Look at the clock; True: a flash dump was given up for its silence."""
        work = self.work
        if work is None or now < self.next_deadline():
            return False
        if work.name == "dump_fram" and work.step is WorkStep.BEGUN:
            self._end(True, "")
            return False
        waited = self._limit(work)
        if work.step is WorkStep.BEGUN:
            if work.name == "dump_flash":
                return True
            self._end(False, f"silent for {waited:g} s")
        elif work.step is WorkStep.SENT:
            self._end(False, f"no sign of it within {waited:g} s")
        else:
            self._end(False, f"not sent within {waited:g} s: the wire is busy or closed")
        return False

    def silent(self) -> str:
        """Why a flash dump was given up."""
        return f"silent for {self._limits.dump_silence:g} s, no end mark"

    def give_up(self, why: str) -> None:
        """End the work, if there is one."""
        if self.work is not None:
            self._end(False, why)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        work = self.work
        return math.inf if work is None else work.last + self._limit(work)

    # -- inside ----------------------------------------------------------------------------------

    def _limit(self, work: Work) -> float:
        if work.step is not WorkStep.BEGUN:
            return self._limits.answer_within
        if work.name == "dump_fram":
            return self._limits.fram_quiet
        return self._limits.dump_silence if work.is_dump else self._limits.wipe_silence

    def _wipe_name(self) -> str:
        work = self.work
        return work.name if work is not None and not work.is_dump else "wipe_flash"

    def _sign(self, name: str, now: float, suffix: str = "") -> None:
        """The flight computer works on this, whoever asked for it."""
        work = self.work
        if work is not None and work.name != name:
            self._end(False, f"the flight computer has begun a {name.replace('_', ' ')} instead")
            work = None
        if work is None:
            work = Work(name, 0, WorkStep.ASKED, now)
        begun = work.step is WorkStep.BEGUN
        self.work = replace(work, step=after(STEPS, work.step, WorkEvent.FIRST_SIGN), last=now)
        if suffix and not begun:
            memory = name.removeprefix("dump_")
            self._events.append(events.DumpStarted(work.token, memory, suffix))

    def _bytes(self, data: bytes, now: float) -> None:
        work = self.work
        if work is None:
            return
        size = work.size + len(data)
        self.work = replace(work, size=size, last=now)
        self._events.append(events.DumpData(data))
        if size - work.told >= _TELL_EACH:
            self.work = replace(self.work, told=size)
            self._events.append(events.WorkProgress(f"{work.text}: {size} bytes", size, 0))

    def _memory_text(self, text: str, now: float) -> None:
        work = self.work
        if work is not None and work.name == "dump_fram":
            self._sign("dump_fram", now, ".txt")
            self._bytes(f"{text}\n".encode(), now)
        else:
            self.notice(Severity.INFO, f"flight computer: {text}")

    def _wipe_ended(self, said: WipeEnded, now: float) -> None:
        work = self.work
        if work is None or work.is_dump:
            self.notice(Severity.INFO, f"flight computer: {said.text}")
        elif work.name == "wipe_fram_and_reboot":
            # Whether the flash could be wiped or not: what is left is the restart.
            self._sign(work.name, now)
            assert self.work is not None
            self.work = replace(self.work, is_wiped=True)
            self.notice(Severity.INFO, f"flight computer: {said.text}")
        else:
            self._end(said.success, said.text)

    def _end(self, success: bool, why: str) -> None:
        work = self.work
        assert work is not None
        self.work = None
        size = f", {work.size} bytes" if work.is_dump else ""
        text = f"{work.text} {'complete' if success else 'failed'}{size}"
        text = f"{text}: {why}" if why else text
        if work.is_dump and work.step is WorkStep.BEGUN:
            self._events.append(events.DumpFinished(work.token, success, text))
        else:
            severity = Severity.INFO if success else Severity.WARNING
            self.notice(severity, text)
        if work.token:
            outcome = Outcome.CONFIRMED if success else Outcome.FAILED
            self._events += ended(work.token, outcome, text, work.sent, success)
