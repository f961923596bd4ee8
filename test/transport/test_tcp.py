"""TCP as a wire, over real sockets on loopback."""

import contextlib
import socket

import pytest
from loop_bench import LOCAL, running


def listen(port=0):
    server = socket.create_server((LOCAL, port))
    server.settimeout(20.0)
    return server


@contextlib.contextmanager
def not_listened():
    """A port at which nobody listens; held, so that no other process comes to it."""
    with socket.socket() as held:
        held.bind((LOCAL, 0))
        yield held.getsockname()[1]


def connect(port):
    client = socket.create_connection((LOCAL, port), timeout=20.0)
    client.settimeout(20.0)
    return client


def test_a_client_connects_hears_and_speaks():
    with listen() as server, running(f"tcp:{LOCAL}:{server.getsockname()[1]}") as node:
        node.link.answer = lambda data: b"answer to " + data
        device, _ = server.accept()
        with device:
            device.settimeout(20.0)
            device.sendall(b"hello")
            assert device.recv(100) == b"answer to hello"
        data, stream = node.link.received[0]
        assert data == b"hello"
        assert stream is not None, "bytes of a stream, no datagram"


def test_the_server_restarts_and_the_client_connects_again(await_until):
    server = listen()
    port = server.getsockname()[1]
    with running(f"tcp:{LOCAL}:{port}") as node:
        device, _ = server.accept()
        device.sendall(b"before")
        await_until(lambda: node.link.heard() == b"before", "it is heard")
        server.close()
        device.close()
        await_until(lambda: not node.wire.is_open, "the end is seen")
        assert None in node.link.ended, "what was half received does not continue"
        with listen(port) as server:
            device, _ = server.accept()
            with device:
                device.sendall(b" and after")
                await_until(lambda: node.link.heard() == b"before and after", "it is heard again")
        first, second = (stream for _, stream in node.link.received)
        assert first != second, "the new connection is a new stream"
        texts = [change.text for change in node.changes]
        assert "closed the connection; trying again each 0.5 s" in texts[1]


def test_a_server_that_only_stops_speaking_is_left(await_until):
    with listen() as server, running(f"tcp:{LOCAL}:{server.getsockname()[1]}") as node:
        device, _ = server.accept()
        with device:
            device.shutdown(socket.SHUT_WR)
            await_until(lambda: not node.wire.is_open, "half-closed is closed")
        again, _ = server.accept()
        again.close()


def test_no_server_is_said_and_does_not_stop_the_loop(await_until):
    with not_listened() as port, running(f"tcp:{LOCAL}:{port}") as node:
        assert f"tcp:{LOCAL}:{port} cannot be opened" in node.changes[0].text
        assert "refused" in node.changes[0].text
        done = []
        node.loop.call(lambda link, now: done.append(now))
        await_until(lambda: done, "calls are still made")
        node.send(b"lost")
        await_until(lambda: node.loop.send_errors == 1, "what cannot be sent is counted")


def test_a_server_hears_several_clients_apart_and_speaks_to_all(await_until):
    with running(f"tcpin:{LOCAL}:0") as node, connect(node.port) as first:
        first.sendall(b"from the first")
        await_until(lambda: len(node.link.received) == 1, "the first is heard")
        second = connect(node.port)
        second.sendall(b"from the second")
        await_until(lambda: len(node.link.received) == 2, "the second is heard")
        assert len({stream for _, stream in node.link.received}) == 2
        node.send(b"to all")
        assert first.recv(100) == b"to all"
        assert second.recv(100) == b"to all"
        second.close()


@pytest.mark.parametrize("end", ["closes", "stops speaking", "resets"])
def test_a_client_goes_and_the_others_stay(await_until, end):
    with running(f"tcpin:{LOCAL}:0") as node, connect(node.port) as stays:
        goes = connect(node.port)
        goes.sendall(b"x")
        await_until(lambda: node.link.received, "it is heard")
        stream = node.link.received[0][1]
        if end == "resets":
            goes.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        if end == "stops speaking":
            goes.shutdown(socket.SHUT_WR)
        else:
            goes.close()
        await_until(lambda: stream in node.link.ended, "its stream ended")
        goes.close()
        node.send(b"still here")
        assert stays.recv(100) == b"still here"
        assert node.wire.is_open


def test_a_client_that_does_not_read_is_let_go_and_its_stream_ends(await_until):
    with running(f"tcpin:{LOCAL}:0") as node, connect(node.port) as reads:
        with connect(node.port) as stuck:
            stuck.sendall(b"x")
            await_until(lambda: node.link.received, "it is heard")
            stream = node.link.received[0][1]
            received = 0
            sent = 0
            while stream not in node.link.ended:
                node.send(bytes(60_000))
                sent += 60_000
                while received < sent:
                    received += len(reads.recv(100_000))
                assert sent < 100_000_000, "never let go"
        node.send(b"still here")
        assert reads.recv(100) == b"still here"


def test_more_clients_than_are_served_are_turned_away():
    with running(f"tcpin:{LOCAL}:0") as node:
        clients = [connect(node.port) for _ in range(9)]
        try:
            assert clients[-1].recv(1) == b"", "the ninth is turned away"
            node.send(b"served")
            assert [client.recv(100) for client in clients[:8]] == [b"served"] * 8
        finally:
            for client in clients:
                client.close()


def test_a_busy_port_is_taken_when_it_is_free(await_until):
    holder = listen()
    with running(f"tcpin:{LOCAL}:{holder.getsockname()[1]}") as node:
        assert "Address already in use" in node.changes[0].text
        holder.close()
        await_until(lambda: node.wire.is_open, "the port is taken")
        with connect(node.port) as client:
            client.sendall(b"hello")
            await_until(lambda: node.link.heard() == b"hello", "a client is heard")
