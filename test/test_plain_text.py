"""Words from a wire or from ROS, written so that no terminal acts on them."""

from hypothesis import given
from hypothesis import strategies as st

from chute_ros.plain_text import plain

#: What moves cursors, begins lines, colours or turns text around.
FORBIDDEN = [chr(code) for code in (*range(0x20), *range(0x7F, 0xA0), 0x2028, 0x2029, 0x202E)]


@given(st.text() | st.text(st.sampled_from(FORBIDDEN)))
def test_no_control_character_is_left_of_any_text(text):
    assert not set(plain(text)) & set(FORBIDDEN)
    plain(text).encode()  # no half of a surrogate pair either


@given(st.text(st.characters(categories=["L", "N", "P", "S"])))
def test_a_text_without_any_stays_as_it_is(text):
    assert plain(text) == text


def test_how_they_are_written():
    assert plain("a\x1b[31mred\r\nb\x9b\x7f é \u202e") == r"a\x1b[31mred\r\nb\x9b\x7f é \u202e"
    assert plain(7) == "7"
