"""A link that spoils packets, between a device that keeps all and a wire."""

import math

import pytest


class Echo:
    """A device that keeps what comes and sends what it is given."""

    def __init__(self):
        self.received, self.output, self.ended, self.deadline = [], [], [], math.inf

    def receive(self, data, now, stream=None):
        self.received.append((now, data))

    def stream_ended(self, stream):
        self.ended.append(stream)

    def update(self, now):
        pass

    def next_deadline(self):
        return self.deadline

    def take_output(self):
        output, self.output = self.output, []
        return output

    def take_events(self):
        return ["event"]


def pass_in(kind, knobs, groups, seed=1):
    """What a device hears of groups of packets, one group every 10 ms. kind: of the link."""
    device = Echo()
    link = kind(device, knobs, seed)
    for number, packets in enumerate(groups):
        link.update(number * 0.01)
        for packet in packets:
            link.receive(packet, number * 0.01)
    link.update(1e6)
    return [data for _, data in device.received]


def pass_out(kind, knobs, groups, seed=1):
    """What the wire gets of them."""
    device = Echo()
    link = kind(device, knobs, seed)
    arrived = []
    for number, packets in enumerate(groups):
        link.update(number * 0.01)
        device.output = list(packets)
        link.update(number * 0.01)
        arrived += link.take_output()
    link.update(1e6)
    return arrived + link.take_output()


BOTH_WAYS = pytest.mark.parametrize("way", [pass_in, pass_out])


def flat(groups):
    return [packet for packets in groups for packet in packets]


def differing(one, other):
    """How many bytes."""
    return sum(a != b for a, b in zip(one, other, strict=True))
