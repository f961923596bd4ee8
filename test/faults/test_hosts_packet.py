"""The packet that is thrown at a vehicle, byte by byte, and what of it is told."""

import struct

from faults import packet
from faults.gap_packet import Stranger, gap_packet
from faults.respawned import RespawnedProcesses

ONE, OTHER = bytes(range(12)), bytes(range(100, 112))


def test_the_packet_is_68_bytes_of_rtps():
    assert gap_packet(ONE, OTHER) == bytes.fromhex(
        "52545053 0203 010f"
        + ONE.hex()  # RTPS 2.3, Fast DDS, the sender
        + "0e01 0c00"
        + OTHER.hex()  # INFO_DST
        + "0801 1c00 000003c7 000003c2"  # GAP: of publications, reader and writer
        + "00000000 e8030000 00010000 00000000"  # from 1000 to 2^40
        + "00000000"  # and no more
    )
    assert len(gap_packet(ONE, OTHER)) == 68


def test_who_announces_himself_is_known_by_the_number_of_his_process():
    stranger = Stranger("127.0.0.1")
    prefix = bytes.fromhex("010f7f01") + struct.pack("<H", 4711) + bytes(6)
    for data in (b"RTPS", b"no such thing" * 3, b"RTPS\2\3\1\x0f" + prefix + b"more"):
        stranger.heard(data)
    stranger.close()
    assert stranger.prefixes == {prefix}
    assert stranger.prefix_of(4711) == prefix
    assert stranger.prefix_of(4711 + 0x10000) == prefix
    assert stranger.prefix_of(4712) is None


def test_what_ends_is_started_again_and_how_it_ended_is_remembered(tmp_path):
    processes = RespawnedProcesses(tmp_path)
    processes.start("one", "this.is.no.module")

    def ends(times):
        while len(processes.ended) < times:
            processes.check()

    try:
        ends(2)
        assert [(one.name, one.code) for one in processes.ended] == [("one", 1), ("one", 1)]
        assert processes.first_end("one") is processes.ended[0]
        assert processes.first_end("other") is None
        assert processes.log("one").read_text().count("No module named") == 2
    finally:
        processes.end()


def test_the_table_has_a_line_for_each_story_and_says_what_stays_in():
    every = [packet.Told(story) for story in packet.STORIES]
    lines = packet.table(every).splitlines()
    assert len(lines) == 2 + len(packet.STORIES)
    assert {line.count("|") for line in lines} == {9}
    assert sum("stays in" in line for line in lines) == 1
