"""Flash and FRAM of the simulated flight computer: information, dump, wipe, snapshots."""

import re

import pytest
from test_flight_computer import Host, standing_by

BEGIN, END = "--- BEGIN FLASH CSV DUMP ---", "--- END FLASH CSV DUMP ---"


def test_the_flash_tells_how_full_it_is():
    host = Host()
    host.send("<I>")
    assert host.others == ["Flash: 1024/14336 KB used (7.1%)"]


def test_a_flight_fills_the_flash_and_a_wipe_empties_it():
    host = Host(flash_used=0, wipe_time=1.0)
    host.act("jump=Coast")
    host.run(10.0)
    host.send("<I>")
    used = int(re.fullmatch(r"Flash: (\d+)/14336 KB used \(0\.\d%\)", host.others[0])[1])
    assert 10 < used < 50
    host.act("land")
    host.send("<W>", 1.5)
    host.forget()
    host.send("<I>")
    assert host.others == ["Flash: 0/14336 KB used (0.0%)"]


# Wipe


def test_a_wipe_tells_its_progress_and_no_telemetry_comes_meanwhile():
    host = Host(wipe_sectors=600, wipe_time=3.0)
    host.run(0.5)
    host.forget()
    host.send("<W>", 0.2)
    before = len(host.records)
    host.run(2.7)
    assert len(host.records) == before
    assert host.others == [
        "Wiping QSPI Flash... Please wait.",
        "Wipe progress: 256/600 sectors",
        "Wipe progress: 512/600 sectors",
    ]
    host.run(0.5)
    assert host.others[3:] == ["Wipe progress: 600/600 sectors", "Flash wiped successfully."]
    assert len(host.records) > before, "it goes on"


@pytest.mark.parametrize(
    ("action", "seconds", "said"),
    [("wipe-fails", 1.0, "ERASE FAILED!"), ("wipe-hangs", 2.0, "ERASE TIMEOUT!")],
)
def test_a_wipe_can_go_wrong_once(action, seconds, said):
    host = Host(wipe_time=1.0)
    host.act(action)
    host.forget()
    host.send("<W>", seconds + 0.5)
    assert host.others[-1] == said
    assert "Wipe progress: 1792/3584 sectors" in host.others
    assert host.records, "telemetry goes on"
    host.forget()
    host.send("<W>", 1.5)
    assert host.others[-1] == "Flash wiped successfully."


# Dump


def test_a_dump_has_a_header_and_the_rows_of_the_flight_and_nothing_in_between():
    host = Host(dump_size=0, debug=True)
    host.act("jump=Coast")
    host.run(5.0)
    host.act("land")
    host.run(0.2)
    host.forget()
    host.send("<G>", 0.15)
    assert host.device.memory.is_dumping
    host.send("<M>", 5.0)
    lines = host.lines[host.lines.index(BEGIN) : host.lines.index(END) + 1]
    assert lines[1] == ",".join(field.name for field in host.layout.fields)
    rows = [host.layout.decode(line) for line in lines[2:-1]]
    assert len(rows) == pytest.approx(50, abs=2)
    assert all(row[0] == 3 for row in rows)
    assert host.newest["mav_open"] == 1, "the flight loop went on"


def test_a_dump_is_as_large_and_as_fast_as_it_is_set_and_loses_nothing():
    host = Host(dump_size=64_000, dump_rate=100.0)
    host.run(0.2)
    host.forget()
    took = None
    host.send("<G>", 0.1)
    took = host.until(lambda: END in host.lines)
    assert took == pytest.approx(10.1, abs=0.5)
    dump = host.raw.split(END.encode())[0]
    assert len(dump) == pytest.approx(64_000, rel=0.03)
    header, *rows = host.lines[2 : host.lines.index(END)]
    assert {row.count(",") for row in rows} == {header.count(",")}
    assert not any("$TELEM" in line for line in host.lines[1 : host.lines.index(END)])


def test_a_dump_waits_for_the_queue():
    host = Host(dump_size=6400, dump_rate=10_000.0, packet_rate=50.0)
    host.run(2.0)
    host.device.queue.clear()
    host.send("<G>", 1.0)
    host.until(lambda: END in host.lines)
    rows = host.lines[host.lines.index(BEGIN) + 2 : host.lines.index(END)]
    assert len(set(rows)) == 1, "no row is cut"
    assert len(rows) == 6400 // (len(rows[0]) + 1)


def test_the_end_of_a_dump_can_be_lost_once_and_telemetry_goes_on():
    host = Host()
    host.act("lose-dump-end")
    host.send("<G>", 2.0)
    assert BEGIN in host.lines
    assert END not in host.lines
    assert host.lines[-1].startswith("$TELEM,")
    host.send("<G>", 2.0)
    assert END in host.lines


@pytest.mark.parametrize("when", ["before", "meanwhile"])
def test_a_dump_can_stall_until_a_reboot(when):
    host = Host(dump_rate=100.0)
    if when == "before":
        host.act("dump-stalls")
    host.send("<G>", 0.5)
    host.act("dump-stalls")
    host.run(2.0)
    host.forget()
    host.run(60.0)
    assert host.raw == b""
    host.send("<R>", 1.0)
    assert host.newest["flight_mode"] == 0


def test_a_binary_dump_is_exactly_its_bytes_between_the_marks():
    host = Host(binary_dump=True, dump_size=5000)
    host.run(0.2)
    host.forget()
    host.send("<G>", 2.0)
    _, _, rest = host.raw.partition(b"--- BEGIN FLASH BINARY DUMP ---\n")
    content, end, rest = rest.partition(b"--- END FLASH BINARY DUMP ---")
    assert end
    assert len(content) == 5000
    assert len(set(content)) == 256
    assert rest.startswith(b"\n$TELEM,")


def test_a_second_job_waits_for_nobody():
    host = Host(wipe_time=1.0)
    host.send("<W>")
    host.send("<G>")
    host.send("<W>", 1.0)
    assert host.others.count("Wiping QSPI Flash... Please wait.") == 1
    assert BEGIN not in host.lines


# Snapshots


def test_the_newest_snapshot_is_shown():
    host = standing_by()
    host.send("<M>")
    host.run(3.0)
    host.send("<f>")
    assert re.fullmatch(
        r"SNAP seq=[34] mode=1 cyc=\d+ p=101325\.0 arm=0\.00 alt=0\.00 mav=1 sv=0", host.others[0]
    )


def test_snapshots_outlive_a_reboot_but_not_their_reset():
    host = standing_by()
    host.run(2.0)
    host.send("<R>", 1.0)
    host.forget()
    host.send("<f>")
    assert host.others[0].startswith("SNAP seq=")
    host.send("<F>")
    host.forget()
    host.send("<f>")
    assert host.others == ["Snapshot: ring empty"]
