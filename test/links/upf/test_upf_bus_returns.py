"""upf_can outlives its bus: a serial CAN adapter that goes away and comes back."""

import os
import select
import threading
import time
import tty
from contextlib import contextmanager

from chute_msgs.msg import LinkHeartbeat
from chute_msgs.srv import Deploy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from upf_bench import Network, tasks

from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.model import LinkState
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack


class Adapter:
    """A serial CAN adapter (slcan) on a pty, with devices on its other side."""

    def __init__(self, path, link):
        self.path, self.link = path, link
        self.ours, theirs = os.openpty()
        tty.setraw(self.ours)
        tty.setraw(theirs)
        self.theirs = theirs
        path.symlink_to(os.ttyname(theirs))
        self._stopping = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def unplug(self):
        self._stopping = True
        self._thread.join()
        self.path.unlink()
        os.close(self.ours)
        os.close(self.theirs)

    def _run(self):
        buffer = b""
        while not self._stopping:
            now = time.monotonic()
            wait = min(max(0.0, self.link.next_deadline() - now), 0.02)
            if select.select([self.ours], [], [], wait)[0]:
                buffer += os.read(self.ours, 4096)
            *lines, buffer = buffer.split(b"\r")
            now = time.monotonic()
            for line in lines:
                frame = frame_of(line)
                if frame is not None:
                    self.link.receive(frame, now)
            self.link.update(now)
            for data in self.link.take_output():
                os.write(self.ours, line_of(data))
            self.link.take_events()


def frame_of(line):
    """A frame of an slcan line "Tiiiiiiiildd.."; None: a command."""
    if not line.startswith(b"T"):
        return None
    return pack(CanFrame(int(line[1:9], 16), bytes.fromhex(line[10:].decode())))


def line_of(data):
    frame = unpack(data)
    return f"T{frame.identifier:08X}{len(frame.data)}{frame.data.hex().upper()}\r".encode()


@contextmanager
def adapter(path, link):
    one = Adapter(path, link)
    try:
        yield one
    finally:
        one.unplug()


def task(diagnostics):
    return tasks(diagnostics).get("link")


def test_an_adapter_that_is_unplugged_and_plugged_in_again_needs_no_restart(bench, tmp_path):
    path = tmp_path / "ttyCAN"
    network = Network(bench, connection=f"slcan:{path}", call_timeout=0.5, give_up_after=10.0)
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    controller, trigger = network.controller(), network.trigger()
    bus = UpfBus([controller, trigger])
    bench.until(
        lambda: task(diagnostics) and str(path) in task(diagnostics).message, "the path is named"
    )
    assert task(diagnostics).level == DiagnosticStatus.ERROR
    with adapter(path, bus):
        bench.until(lambda: beats[-1].device_healthy, "the devices are heard")
        bench.until(lambda: task(diagnostics).level == DiagnosticStatus.OK, "diagnostics are well")
    bench.until(lambda: beats[-1].link_state == LinkState.LOST, "they are lost")
    bench.until(lambda: task(diagnostics).level == DiagnosticStatus.ERROR, "diagnostics say so")
    with adapter(path, bus):
        bench.until(lambda: beats[-1].device_healthy, "they are heard again")
        answer = bench.call(Deploy, "upf_can/deploy", force=True, reason="a test")
        assert answer.success, answer.message
    assert trigger.fired
