"""Signing: who holds the key may speak; nobody else, and nobody twice."""

import hashlib

import pytest

from chute_ros.errors import SigningKeyError
from chute_ros.protocol.mavlink import signing
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.signing import Signer, SigningClock, Verifier, key_from_text

KEY, OTHER = bytes(range(32)), bytes(32)
#: Unix time less monotonic time: the host was started on 2026-01-01.
OFFSET = 1767225600.0
NOW = 500.0


def clock():
    return SigningClock(OFFSET)


def signed(key=KEY, now=NOW, link=0, ids=(1, 161), signer=None):
    encoder = FrameEncoder(*ids, signer or Signer(key, clock(), link))
    return encoder.encode(d.MAVLink_heartbeat_message(37, 8, 0, 0, 3, 3), now)


def signed_time(now):
    return int.from_bytes(signed(now=now)[-12:-6], "little")


def reader():
    return FrameDecoder(Verifier(KEY, clock()))


def test_a_signature_is_what_the_guide_prescribes():
    raw = signed(link=7)
    assert raw[2] == 0x01
    frame, link, stamp, signature = raw[:-13], raw[-13], raw[-12:-6], raw[-6:]
    assert link == 7
    expected = int((NOW + OFFSET - 1420070400) * 100_000)
    assert int.from_bytes(stamp, "little") == expected
    digest = hashlib.sha256(KEY + frame + bytes([link]) + stamp).digest()
    assert signature == digest[:6]
    # A rightly signed frame is read and marked.
    (frame,) = reader().feed_datagram(signed(), NOW)
    assert frame.signed


def dropped(decoder, raw, reason, now=NOW):
    """A frame is dropped for this reason, the first one that is."""
    return decoder.feed_datagram(raw, now) == [] and decoder.counts[reason] == 1


def test_a_frame_that_is_unsigned_wrongly_signed_or_replayed_is_dropped_and_counted():
    plain = FrameEncoder(1, 161).encode(d.MAVLink_heartbeat_message(37, 8, 0, 0, 3, 3), NOW)
    assert dropped(reader(), plain, signing.UNSIGNED)
    assert dropped(reader(), signed(key=OTHER), signing.WRONG_SIGNATURE)
    decoder, raw = reader(), signed()
    assert len(decoder.feed_datagram(raw, NOW)) == 1
    assert dropped(decoder, raw, signing.REPLAYED, NOW + 1.0)
    plain = FrameEncoder(51, 68).encode(d.MAVLink_radio_status_message(*[0] * 7), NOW)
    assert len(reader().feed_datagram(plain, NOW)) == 1, "a radio may report without a key"


def test_a_frame_of_a_minute_ago_does_not_open_a_stream():
    assert len(reader().feed_datagram(signed(now=NOW - 59.0), NOW)) == 1
    assert dropped(reader(), signed(now=NOW - 61.0), signing.REPLAYED)


def test_a_stream_that_falls_back_by_more_than_a_minute_is_not_heard_any_more():
    """As one whose frames are recorded, held back, and let through ever later."""
    decoder = reader()
    assert len(decoder.feed_datagram(signed(now=NOW), NOW)) == 1
    assert len(decoder.feed_datagram(signed(now=NOW + 1.0), NOW + 60.0)) == 1
    assert decoder.feed_datagram(signed(now=NOW + 2.0), NOW + 63.0) == []
    assert decoder.counts[signing.REPLAYED] == 1


def test_what_was_heard_before_a_restart_is_not_heard_after_it():
    ours = clock()
    signer, verifier = Signer(KEY, ours), Verifier(KEY, ours)
    recorded = signed(now=NOW)
    assert len(FrameDecoder(verifier).feed_datagram(recorded, NOW)) == 1
    before = signing.times_of(signer, verifier)
    assert list(before.streams) == [(1, 161, 0)]
    assert before.newest == before.streams[1, 161, 0], "nothing was sent"
    again = FrameDecoder(Verifier(KEY, clock(), before.streams))
    assert again.feed_datagram(recorded, NOW) == []
    assert again.counts[signing.REPLAYED] == 1
    assert len(again.feed_datagram(signed(now=NOW + 0.1), NOW + 0.1)) == 1
    assert (1, 161, 0) in before.streams
    assert before.streams[1, 161, 0] < signed_time(now=NOW + 0.1), "it is a picture of then"


def test_a_device_whose_clock_is_at_its_end_is_not_followed_there():
    """Our own times would begin at 0 again, and no device would take an order any more."""
    ours = clock()
    signer, decoder = Signer(KEY, ours), FrameDecoder(Verifier(KEY, ours))
    ends_in = (2**48 - 1 - ours.at(NOW)) / signing.UNITS_PER_SECOND
    assert decoder.feed_datagram(signed(now=NOW + ends_in - 10.0), NOW) == []
    assert decoder.counts[signing.END_OF_TIME] == 1
    assert len(decoder.feed_datagram(signed(), NOW)) == 1, "all others are heard"
    year = 365 * 86400.0
    assert len(decoder.feed_datagram(signed(now=NOW + ends_in - year - 10.0), NOW)) == 1
    assert signer.next_timestamp(NOW + year) < 2**48


def test_what_we_have_given_out_counts_among_the_newest():
    ours = clock()
    signer = Signer(KEY, ours)
    given = signer.next_timestamp(NOW)
    assert signing.times_of(signer, Verifier(KEY, ours)) == signing.Times(given, {})


def test_one_forged_frame_with_a_high_time_does_not_shut_out_the_true_sender():
    decoder = reader()
    assert decoder.feed_datagram(signed(key=OTHER, now=NOW + 1e6), NOW) == []
    assert len(decoder.feed_datagram(signed(), NOW)) == 1


def test_streams_of_other_links_and_components_have_their_own_time():
    decoder = reader()
    assert len(decoder.feed_datagram(signed(now=NOW + 10.0), NOW)) == 1
    assert len(decoder.feed_datagram(signed(now=NOW, link=1), NOW)) == 1
    assert len(decoder.feed_datagram(signed(now=NOW, ids=(1, 1)), NOW)) == 1


def test_streams_that_a_holder_of_the_key_makes_up_do_not_grow_us():
    decoder = reader()
    for number in range(signing.MOST_STREAMS):
        decoder.feed_datagram(signed(ids=(1 + number % 250, 1 + number // 250)), NOW)
    assert decoder.feed_datagram(signed(ids=(251, 1)), NOW) == []
    assert decoder.counts[signing.TOO_MANY_STREAMS] == 1
    assert decoder.feed_datagram(signed(now=NOW + 1.0, ids=(1, 1)), NOW), "a known one goes on"


def test_one_changed_byte_anywhere_in_a_signed_frame_is_enough_to_drop_it():
    for at in range(1, len(signed())):
        raw = bytearray(signed())
        raw[at] ^= 0x01
        decoder = reader()
        assert decoder.feed_datagram(bytes(raw), NOW) == [], at
        assert len(decoder.feed_datagram(signed(), NOW)) == 1, at


def test_a_host_that_thinks_it_is_1970_can_still_sign():
    encoder = FrameEncoder(1, 191, Signer(KEY, SigningClock(-NOW)))
    message = d.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    stamps = [int.from_bytes(encoder.encode(message, NOW)[-12:-6], "little") for _ in range(3)]
    assert stamps == [1, 2, 3]


def test_our_own_times_rise_even_within_a_moment_and_follow_a_clock_that_is_ahead():
    signer = Signer(KEY, clock())
    times = [signer.next_timestamp(NOW) for _ in range(5)]
    assert times == sorted(set(times))
    ours = clock()
    # By monotonic time, whatever the wall clock does.
    assert ours.at(NOW + 1.0) - ours.at(NOW) == pytest.approx(100_000, abs=1)
    FrameDecoder(Verifier(KEY, ours)).feed_datagram(signed(now=NOW + 30.0), NOW)
    assert ours.at(NOW) >= clock().at(NOW + 30.0)


def test_a_key_is_32_bytes_or_64_digits():
    for text in (KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n"):
        assert key_from_text(text, "key") == KEY, text
    for text in (b"", b"short", KEY + b"\n", b"z" * 64, b"0 " * 32, bytes(64)):
        with pytest.raises(SigningKeyError, match=r"my\.key holds .* head -c 32"):
            pytest.fail(f"{text} became {key_from_text(text, 'my.key')}")
