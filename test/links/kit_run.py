"""A run of a conformance kit on a simulated device, and what it found."""

from chute_ros.conformance.clause import Result
from chute_ros.conformance.session import Ended
from chute_ros.conformance.virtual import VirtualLine


class KitRun:
    """Kit and device on one line."""

    def __init__(self, session, device):
        self.session, self.device = session, device
        self.line = VirtualLine(session, device)

    def to(self, until=lambda: False):
        """To its end, or until this holds."""
        self.line.run(until)
        return self

    def silenced(self):
        """To its end, as the device falls silent once the first clause was tried."""
        self.to(lambda: bool(self.results))
        self.device.act("silent")
        self.to()
        assert self.problem.startswith("the device fell silent")
        return self

    @property
    def results(self):
        """By clause."""
        return {one.clause.name: one for one in self.line.events if isinstance(one, Result)}

    def of(self, verdict):
        """The clauses with this verdict."""
        return [name for name, one in self.results.items() if one.verdict is verdict]

    @property
    def problem(self):
        """How it ended."""
        (ended,) = (one for one in self.line.events if isinstance(one, Ended))
        return ended.problem
