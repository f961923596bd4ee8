"""STATUSTEXT in chunks: cut up, and put together from what comes of it."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.links.mavlink.protocol.status_texts import (
    CHUNK,
    CHUNK_SILENCE,
    MOST_CHUNKS,
    MOST_OPEN,
    MOST_SENT,
    StatusText,
    StatusTexts,
    chunked,
)
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder

LONG = "upf_can never heard: flight blocked until its node is started and heard by the supervisor"


def over_the_wire(messages):
    encoder, decoder = FrameEncoder(1, 191), FrameDecoder()
    return [decoder.feed_datagram(encoder.encode(one, 0.0), 0.0)[0].message for one in messages]


def part(text, text_id, number, severity=4):
    return d.MAVLink_statustext_message(severity, text.encode(), text_id, number)


def fed(texts, *messages, now=0.0):
    return [one.text for message in messages for one in texts.feed(message, now)]


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
    texts = StatusTexts()
    (whole,) = [one for message in sent for one in texts.feed(message, 0.0)]
    assert whole.severity == 3
    most = MOST_SENT * CHUNK - 1
    assert whole.text == (text if len(text) <= most else text[: most - 3] + "...")
    assert len(sent) <= MOST_SENT


def test_chunks_in_any_order_and_of_two_texts_at_once():
    texts = StatusTexts()
    assert fed(texts, part("b" * 50, 1, 1), part("C", 2, 1), part("a" * 50, 1, 0)) == []
    assert fed(texts, part("c" * 50, 2, 0)) == ["c" * 50 + "C"]
    assert fed(texts, part("", 1, 2)) == ["a" * 50 + "b" * 50]


def test_a_lost_chunk_shows():
    texts = StatusTexts()
    assert fed(texts, part("a" * 50, 1, 0), part("end", 1, 2)) == []
    assert texts.next_deadline() == CHUNK_SILENCE
    assert texts.update(CHUNK_SILENCE - 0.01) == []
    assert texts.update(CHUNK_SILENCE) == [StatusText(4, "a" * 50 + "...end")]
    assert texts.update(9.0) == []
    assert fed(texts, part("a" * 50, 2, 0)) == []
    assert fed(texts, part("next", 0, 0), now=5.0) == ["a" * 50 + "...", "next"]


def test_chunks_without_end_and_texts_without_number_do_not_grow_us():
    texts = StatusTexts()
    for text_id in range(1, 200):
        texts.feed(part("a" * 50, text_id, 0), 0.0)
        assert len(texts._open) <= MOST_OPEN
    texts = StatusTexts()
    told = fed(texts, *(part("a" * 50, 1, number) for number in range(MOST_CHUNKS + 1)))
    assert told == ["a" * 50 * MOST_CHUNKS + "..."]


@given(
    st.lists(
        st.tuples(st.integers(0, 5), st.integers(0, 255), st.binary(max_size=50)), max_size=60
    )
)
def test_whatever_comes_is_bounded_and_raises_nothing(said):
    texts = StatusTexts()
    for at, (text_id, number, raw) in enumerate(said):
        texts.feed(d.MAVLink_statustext_message(6, raw, text_id, number), at * 0.1)
        assert len(texts._open) <= MOST_OPEN


@pytest.mark.parametrize("raw", [b"\xff\xfe", b"a\0b"])
def test_bytes_that_are_no_text(raw):
    (whole,) = StatusTexts().feed(d.MAVLink_statustext_message(6, raw), 0.0)
    assert whole.text in ("\ufffd\ufffd", "a")
