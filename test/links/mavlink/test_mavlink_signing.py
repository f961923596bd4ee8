"""A signing key: refused if it is not safe, and then used in both directions."""

import time

import pytest
from chute_msgs.msg import LinkHeartbeat
from chute_msgs.srv import Arm
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mavlink_bench import Module, Network

from chute_ros.errors import SigningKeyError
from chute_ros.model import LinkState
from chute_ros.protocol.mavlink.frames import FrameDecoder
from chute_ros.protocol.mavlink.signing import Signer, SigningClock, Verifier

KEY, OTHER_KEY = bytes(range(32)), bytes(32)


class SigningModule(Module):
    """Signs what it says, and hears only what is signed."""

    def __init__(self, key):
        super().__init__()
        clock = SigningClock(time.time() - time.monotonic())
        self.sign(Signer(key, clock, 3), Verifier(key, clock))
        self.verified = self._decoders[None] = FrameDecoder(self.verifier)


@pytest.fixture
def key_file(tmp_path):
    path = tmp_path / "signing.key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    return path


def test_signed_both_ways_they_understand_each_other(bench, key_file):
    key_file.write_bytes(KEY.hex().upper().encode() + b"\n")
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    module = SigningModule(KEY)
    Network(bench, signing_key_file=str(key_file)).plug(module)
    bench.until(lambda: beats and beats[-1].device_healthy, "the signed module is heard")
    answer = bench.call(Arm, "mavlink_parachute/arm", arm=True)
    assert answer.success, answer.message
    assert module.commands_heard
    assert not any(module.verified.counts.values()), (
        "every frame of the node bore a good signature"
    )


@pytest.mark.parametrize(
    ("device", "reason"),
    [
        (Module, "frame without a signature"),
        (lambda: SigningModule(OTHER_KEY), "frame with a wrong signature"),
    ],
)
def test_who_does_not_sign_with_the_key_is_not_heard_but_counted(bench, key_file, device, reason):
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    Network(bench, signing_key_file=str(key_file)).plug(device())

    def counted():
        statuses = (status for array in diagnostics for status in array.status)
        pairs = (pair for status in statuses for pair in status.values)
        return any(pair.key == f"dropped: {reason}" and int(pair.value) > 5 for pair in pairs)

    bench.until(counted, "it is counted")
    links = [s for array in diagnostics for s in array.status if s.name.endswith(": link")]
    assert links[-1].level == DiagnosticStatus.ERROR
    assert f"the received data cannot be read, mostly: {reason} (" in links[-1].message
    assert {beat.link_state for beat in beats} == {LinkState.NEVER_SEEN}
    assert not bench.call(Arm, "mavlink_parachute/arm", arm=True).success


def refusal(bench, path):
    with pytest.raises(SigningKeyError) as caught:
        Network(bench, signing_key_file=str(path))
    return str(caught.value)


def test_a_key_that_others_can_reach_is_refused(bench, key_file):
    for mode in (0o640, 0o604, 0o660, 0o622, 0o777):
        key_file.chmod(mode)
        said = refusal(bench, key_file)
        assert f"parameter signing_key_file: {key_file}" in said, oct(mode)
        assert f"chmod 600 {key_file}" in said, oct(mode)


def test_a_key_of_the_wrong_size_or_kind_is_refused_without_showing_it(bench, key_file):
    for text in (b"", KEY[:31], KEY + b"\n", KEY.hex()[:-1].encode(), b"z" * 64):
        key_file.write_bytes(text)
        said = refusal(bench, key_file)
        assert f"parameter signing_key_file: {key_file} holds {len(text)} bytes" in said
        assert "need 32 raw bytes or 64 hexadecimal digits" in said, text
        assert not text or text.decode("latin-1") not in said
    assert "no-such-key: No such file or directory" in refusal(
        bench, key_file.parent / "no-such-key"
    )
