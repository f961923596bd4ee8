"""A TCP server gives a place back that sends no frame; who sends frames keeps his."""

import contextlib

import pytest
from loop_bench import LOCAL, Recorder, Running
from test_tcp import connect

from chute_ros.transport import tcp
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire_events import WireTrouble

FRAME = b"frame"


@pytest.fixture
def node(monkeypatch):
    """A server that waits half a second for a frame, over a protocol that knows one frame."""
    monkeypatch.setattr(tcp, "GIVE_BACK_AFTER", 0.5)
    one = Running(f"tcpin:{LOCAL}:0")
    one.link = Recorder()

    def frames():
        return sum(data == FRAME for data, _ in one.link.received)

    one.loop.stop()
    one.loop = WireLoop(one.link, one.wire, one.delivered.extend, frames=frames)
    one.loop.start()
    yield one
    one.loop.stop()


def is_let_go(client):
    return client.recv(1) == b""


@pytest.mark.parametrize("sent", [b"", b"noise"])
def test_clients_that_send_no_frame_lose_their_places_to_true_ones(node, await_until, sent):
    idle = [connect(node.port) for _ in range(8)]
    for client in idle:
        client.sendall(sent)
    assert all(is_let_go(client) for client in idle)
    await_until(lambda: not node.wire.files()[1:], "all places are free")
    with connect(node.port) as true:
        true.sendall(FRAME)
        await_until(lambda: FRAME in node.link.heard(), "it is heard")
        node.send(b"to you")
        assert true.recv(100) == b"to you"
    told = [event.text for event in node.delivered if isinstance(event, WireTrouble)]
    assert len(told) == 1, "once, however many there are"
    assert "a client sent no accepted frame for 0.5 s and was disconnected" in told[0]
    for client in idle:
        client.close()


def test_a_client_that_sends_noise_all_the_time_is_let_go(node):
    with connect(node.port) as noisy:
        noisy.settimeout(0.05)
        ended = False
        while not ended:
            try:
                noisy.sendall(b"noise")
                ended = noisy.recv(1) == b""
            except TimeoutError:
                continue
            except ConnectionError:
                ended = True


def test_a_client_that_sends_frames_is_never_dropped_for_newcomers(node):
    with connect(node.port) as true:
        newcomers = {connect(node.port) for _ in range(12)}
        for client in newcomers:
            client.settimeout(0.05)
        while newcomers:
            true.sendall(FRAME)
            for client in list(newcomers):
                with contextlib.suppress(TimeoutError):
                    if is_let_go(client):
                        newcomers.remove(client)
                        client.close()
        node.send(b"still here")
        assert true.recv(100) == b"still here"


def test_silence_after_a_frame_costs_the_place_as_well(node, await_until):
    with connect(node.port) as gone_quiet:
        gone_quiet.sendall(FRAME)
        await_until(lambda: node.link.received, "it is heard")
        assert is_let_go(gone_quiet)


def test_the_limit_is_well_above_what_a_heartbeat_a_second_needs():
    assert tcp.GIVE_BACK_AFTER >= 5.0
