"""Every word of what is said of a file that is not right."""

import pytest

from chute_ros.errors import ProfileError
from chute_ros.supervisor.yaml_lines import ProfileLines, Where, compose

#: So says PyYAML itself.
UNREADABLE = """\
unacceptable character #x0000: special characters are not allowed
  in "<unicode string>", position 8"""


def read(text: str) -> tuple[ProfileLines, dict[str, Where]]:
    """The entries of a text, and a reader that has found no mistake so far."""
    reader = ProfileLines("f.yaml", ())
    return reader, reader.mapping(compose(text, "f.yaml"), (), "it")


def test_an_unknown_key_is_told_with_all_that_may_be():
    reader = ProfileLines("f.yaml", ())
    root = compose("heigt: 1\nzzz: 2\n", "f.yaml")
    assert reader.mapping(root, ("weight", "height", "speed"), "a thing") == {}
    may = "it may have weight, height, speed"
    assert reader.mistakes == [
        f"f.yaml, line 1: a thing has no 'heigt': did you mean height? {may}",
        f"f.yaml, line 2: a thing has no 'zzz': {may}",
    ]


def test_what_is_no_mapping_and_what_is_there_twice_is_told():
    reader, entries = read("a: 1\na: 2\nb: [3]\n")
    assert [(key, one.value, one.line) for key, one in entries.items()] == [
        ("a", 1, 1),
        ("b", "a list", 3),
    ]
    assert reader.mapping(entries["b"], (), "a thing") == {}
    assert reader.mistakes == [
        "f.yaml, line 2: 'a' is there twice: remove one",
        "f.yaml, line 3: a thing is 'a list': need `key: value` lines",
    ]


def test_a_number_may_reach_the_ends_of_its_range():
    reader, entries = read("least: 1\nmost: 5\nless: 0.5\nmore: 5.5\nyes: true\n")
    for key, number in (("least", 1.0), ("most", 5.0)):
        assert reader.number(entries[key], key, 1.0, 5.0) == number
    for key in ("less", "more", "yes"):
        reader.number(entries[key], key, 1.0, 5.0)
    assert reader.mistakes == [
        "f.yaml, line 3: less is 0.5: need 1 to 5",
        "f.yaml, line 4: more is 5.5: need 1 to 5",
        "f.yaml, line 5: yes is True: need a number",
    ]


def test_another_word_is_told_with_the_nearest_and_read_as_the_first():
    reader, entries = read("a: kil\nb: zzz\nc: 7\n")
    for key in "abc":
        assert reader.choice(entries[key], key, ("deploy", "kill")) == "deploy"
    assert reader.choice(entries["b"], "b", ["only"]) == "only"
    assert reader.mistakes == [
        "f.yaml, line 1: a is 'kil': need deploy or kill (did you mean kill?)",
        "f.yaml, line 2: b is 'zzz': need deploy or kill",
        "f.yaml, line 3: c is 7: need deploy or kill",
        "f.yaml, line 2: b is 'zzz': need only",
    ]


def test_words_are_read_in_one_line_and_nothing_else_is_words():
    reader, entries = read("a: it  falls,\n   fast\nb: ' '\nc: {d: e}\nf: 2024-05-01\n")
    assert reader.text(entries["a"], "a") == "it falls, fast"
    for key in "bcf":
        assert reader.text(entries[key], key) == ""
    assert reader.mistakes == [
        "f.yaml, line 3: b is ' ': need words",
        "f.yaml, line 4: c is 'a mapping': need words",
        "f.yaml, line 5: f is datetime.date(2024, 5, 1): need words",
    ]


def test_a_list_has_an_entry_and_one_alone_needs_no_brackets():
    reader, entries = read("a: [1,\n 2]\nb: 3\nc: []\n")
    assert [(one.value, one.line) for one in reader.many(entries["a"], "a")] == [(1, 1), (2, 2)]
    assert [(one.value, one.line) for one in reader.many(entries["b"], "b")] == [(3, 3)]
    assert reader.many(entries["c"], "c") == []
    assert reader.mistakes == ["f.yaml, line 4: c is empty: need at least one"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\n b: {\n", "line 2: not YAML: mapping values are not allowed here"),
        ("a: *nobody\n", "line 1: not YAML: found undefined alias 'nobody'"),
        ("a: 1\n---\nb: 1\n", "line 2: not YAML: but found another document"),
        ("a: 1\nb: \x00\n", f"line 1: not YAML: {UNREADABLE}"),
    ],
)
def test_what_is_not_yaml_says_where_and_why(text, words):
    with pytest.raises(ProfileError) as caught:
        compose(text, "f.yaml")
    assert str(caught.value) == f"f.yaml, {words}"


def test_values_are_read_as_yaml_says_and_quoted_ones_as_words():
    _, entries = read("a: 7\nb: '7'\nc: 2024-13-45\nd: {}\ne: ~\n")
    values = {key: one.value for key, one in entries.items()}
    assert values == {"a": 7, "b": "7", "c": "2024-13-45", "d": "a mapping", "e": None}
    assert [key for key, one in entries.items() if one.is_mapping] == ["d"]
    nothing = compose("", "f.yaml")
    assert (nothing.value, nothing.line, nothing.is_mapping) == (None, 1, False)
