"""STATUSTEXT in chunks: cut up, and put together by whoever reads it."""

import struct

from hypothesis import given
from hypothesis import strategies as st

from chute_ros.links.mavlink.protocol.status_texts import (
    CHUNK,
    MOST_SENT,
    chunked,
)
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder

LONG = "upf_can never heard: flight blocked until its node is started and heard by the supervisor"


def over_the_wire(messages):
    encoder, decoder = FrameEncoder(1, 191), FrameDecoder()
    return [decoder.feed_datagram(encoder.encode(one, 0.0), 0.0)[0].message for one in messages]


def test_golden_chunks():
    first, second = chunked(LONG, d.MAV_SEVERITY_WARNING, 0x0102)
    payloads = [bytes(FrameEncoder(1, 191).encode(one, 0.0))[10:-2] for one in (first, second)]
    raw = LONG.encode()
    assert payloads == [
        struct.pack("<B50sHB", 4, raw[:50], 0x0102, 0).rstrip(b"\0"),
        struct.pack("<B50sHB", 4, raw[50:], 0x0102, 1),
    ]


def test_short_text_is_one_message_and_letters_beyond_ascii_do_not_shift_the_cuts():
    # Short text is one message without an id.
    (only,) = chunked("x" * CHUNK, 2, 9)
    assert (only.id, only.chunk_seq, only.severity, len(only.text)) == (0, 0, 2, CHUNK)
    # Letters beyond ascii do not shift the cuts.
    assert [len(one.text) for one in chunked("ä" * 120, 3, 7)] == [50, 50, 20]


@given(st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=600))
def test_what_is_cut_up_is_put_together(text):
    sent = over_the_wire(chunked(text, 3, 7))
    most = MOST_SENT * CHUNK - 1
    whole = "".join(one.text for one in sent)
    assert whole == (text if len(text) <= most else text[: most - 3] + "...")
    assert len(sent) <= MOST_SENT
    assert [one.chunk_seq for one in sent] == list(range(len(sent)))
    assert {one.severity for one in sent} == {3}
    # A reader takes the chunk that is not full for the last.
    *others, last = [len(one.text) for one in sent]
    assert set(others) <= {CHUNK}
    assert last < CHUNK or len(sent) == 1
