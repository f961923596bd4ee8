"""One line to what it says: every text of the firmware, cut lines, and what is nothing known."""

import pytest
from umbilical_lines import PAD

from chute_ros.links.umbilical.protocol.line_parser import (
    CUT_LINE,
    UNKNOWN_LINE,
    ArmingBlocked,
    FlashUsage,
    LogLine,
    MemoryText,
    StrayMark,
    Telemetry,
    WipeBegan,
    WipeEnded,
    WipeProgress,
    printable,
    recognise,
)
from chute_ros.protocol.events import Severity

WHOLE = PAD.removesuffix(b"\n")
BODY = WHOLE.decode().removeprefix("$TELEM,")
MARK = "\N{REPLACEMENT CHARACTER}"

#: What comes, and what it says.
KNOWN = {
    b"[ERROR] flash: erase failed": LogLine(Severity.ERROR, "flash: erase failed"),
    b"[WARN] GPS: no fix": LogLine(Severity.WARNING, "GPS: no fix"),
    b"[INFO] ready": LogLine(Severity.INFO, "ready"),
    b"[DEBUG] x=1": LogLine(Severity.INFO, "x=1"),
    b"[TRACE] loop": LogLine(Severity.INFO, "loop"),
    b"[INFO] ": LogLine(Severity.INFO, ""),
    "[INFO] 21 °C, Höhe 3 µm ✓".encode(): LogLine(Severity.INFO, "21 °C, Höhe 3 µm ✓"),
    b"[INFO] Flash wiped successfully.": LogLine(Severity.INFO, "Flash wiped successfully."),
    b"[INFO] --- BEGIN FLASH CSV DUMP ---": LogLine(Severity.INFO, "--- BEGIN FLASH CSV DUMP ---"),
    b"[INFO] --- END FLASH CSV DUMP ---": LogLine(Severity.INFO, "--- END FLASH CSV DUMP ---"),
    b"SNAP seq=12 mode=4 alt=1250.5": MemoryText("SNAP seq=12 mode=4 alt=1250.5"),
    b"Snapshot: ring empty": MemoryText("Snapshot: ring empty"),
    b"FRAM reset": MemoryText("FRAM reset"),
    b"FRAM: 3 entries, [0] [1] [2]": MemoryText("FRAM: 3 entries, [0] [1] [2]"),
    b"Flash: 1024/14336 KB used (7.1%)": FlashUsage(1024, 14336),
    b"Flash: 0/14336 KB used (0.0%)": FlashUsage(0, 14336),
    b"Flash: 999999999/999999999 KB used (100%)": FlashUsage(999999999, 999999999),
    b"Wiping QSPI Flash... Please wait.": WipeBegan(),
    b"Wipe progress: 3/56 sectors": WipeProgress(3, 56),
    b"Wipe progress: 0/0 sectors": WipeProgress(0, 0),
    b"Flash wiped successfully.": WipeEnded(True, "Flash wiped successfully."),
    b"ERASE FAILED!": WipeEnded(False, "ERASE FAILED!"),
    b"ERASE TIMEOUT!": WipeEnded(False, "ERASE TIMEOUT!"),
    b"Arming blocked: wipe flash first": ArmingBlocked("Arming blocked: wipe flash first"),
    b"--- BEGIN FLASH CSV DUMP ---": StrayMark(),
    b"--- BEGIN FLASH BINARY DUMP ---": StrayMark(),
    b"--- END FLASH CSV DUMP ---": StrayMark(),
    b"--- END FLASH BINARY DUMP ---": StrayMark(),
    WHOLE: Telemetry(BODY),
    b"$TELEM,": Telemetry(""),
    b"$TELEM,1,x": Telemetry("1,x"),
}
#: Cut off here, on a multiple of the 64 bytes of a packet, or in the middle of anything else.
CUTS = [1, 7, 8, 9, *range(64, len(WHOLE), 64), len(WHOLE) - 1, len(WHOLE)]


@pytest.mark.parametrize("line", KNOWN, ids=lambda line: ascii(line[:40]))
def test_a_line_says_its_own_also_on_the_heels_of_one_that_was_cut(line):
    said = KNOWN[line]
    assert recognise(line) == (said, "")
    for cut in CUTS:
        assert recognise(WHOLE[:cut] + line) == (said, CUT_LINE), cut
    for first in (b"Wipe progress: 3/56 sectors", b"Wiping QSPI Flash... Please"):
        for cut in (1, 10, 13, 19):
            assert recognise(first[:cut] + line) == (said, CUT_LINE), (first, cut)


def test_of_cut_records_the_last_is_taken_and_one_at_the_end_has_too_few_fields():
    for cut in range(64, len(WHOLE), 64):
        assert recognise(WHOLE[:cut] * 3 + WHOLE) == (Telemetry(BODY), CUT_LINE), cut
    assert recognise(WHOLE[:64]) == (Telemetry(BODY[:57]), "")
    assert recognise(b"") == (None, ""), "nothing is nothing, and not counted"


NOTHING_KNOWN = [
    *(b"hello", b" ", b"\r", b"\0", b"\xff\xfe", b"$TELEM", b"$telem,1,2", b"TELEM,1,2", b"1,2,3"),
    *(b"[info] lower case", b"[INFO]no space", b"[FATAL] strange level"),
    *(b"Flash: 1024/14336 KB used (7.1%) or so", b"Flash: -1/14336 KB used (7.1%)"),
    b"Flash: 1234567890/14336 KB used (7.1%)",
    "Flash: \u0661/14336 KB used (7.1%)".encode(),
    *(b"Wipe progress: 3/56 sectors of many", b"Wipe progress: three/56 sectors"),
    *(b"Flash wiped successfully", b"ERASE FAILED", b"--- BEGIN FLASH CSV DUMP --"),
    *(b"--- END FLASH OTHER DUMP ---", b"arming blocked: no", b"x" * 8192),
]


def test_what_is_nothing_known():
    for line in NOTHING_KNOWN:
        assert recognise(line) == (None, UNKNOWN_LINE), line


@pytest.mark.parametrize("start", [b"[INFO] ", b"SNAP seq=", b"FRAM ", b"Arming blocked: "])
def test_nothing_of_a_line_reaches_a_terminal_that_could_move_it(start):
    said, reason = recognise(start + b"a\x1b[2Jb\x07\tc\x00\x7f" + "\u202ed\u2028".encode())
    seen = f"a{MARK}[2Jb{MARK}{MARK}c{MARK}{MARK}{MARK}d{MARK}"
    assert said.text.endswith(seen)
    assert said.text.isprintable()
    assert reason == ""


def test_what_can_be_seen_is_left_as_it_is_and_what_is_no_text_is_shown_as_marks():
    assert printable("21 °C ✓") == "21 °C ✓"
    assert printable("") == ""
    assert recognise(b"[WARN] \xff\xc3") == (LogLine(Severity.WARNING, MARK * 2), "")
    # A character that was cut does not swallow what follows.
    assert recognise("[INFO] 21 °".encode()[:-1] + WHOLE) == (Telemetry(BODY), CUT_LINE)


def test_the_first_level_counts_where_a_log_line_quotes_another():
    quotes = LogLine(Severity.WARNING, "said: [ERROR] no")
    assert recognise(b"[WARN] said: [ERROR] no") == (quotes, "")


def test_what_matters_is_not_lost_on_the_heels_of_a_cut_log_line():
    for line in (
        *(b"Flash wiped successfully.", b"ERASE FAILED!", b"ERASE TIMEOUT!"),
        *(b"Wipe progress: 3/56 sectors", b"Arming blocked: wipe flash first"),
        b"Flash: 1024/14336 KB used (7.1%)",
    ):
        assert recognise(b"[INFO] Refere" + line) == (recognise(line)[0], CUT_LINE), line


def test_a_log_line_that_speaks_of_telemetry_or_of_the_fram_is_a_log_line():
    for text in ("$TELEM,1,2 sent", "UMBILICAL CMD: Dump FRAM", "Snapshot ring reset."):
        said, reason = recognise(f"[DEBUG] {text}".encode())
        assert (said, reason) == (LogLine(Severity.INFO, text), "")
    assert recognise(b"Unknown command FRAM?") == (None, UNKNOWN_LINE)
