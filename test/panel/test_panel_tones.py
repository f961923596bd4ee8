"""The colours of the panel, as those see them who do not see all colours."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import pytest

from chute_ros.tools.panel import vehicle_page
from chute_ros.tools.panel.tones import TONES
from chute_ros.tools.timeline_rows import TONES as NAMES

#: Machado, Oliveira and Fernandes 2009, severity 1.0: linear RGB as seen without one cone.
SEEN = {
    "all cones": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "protanopia": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.011820, 0.042940, 0.968881),
    ),
    "tritanopia": (
        (1.255528, -0.076749, -0.178779),
        (-0.078411, 0.930809, 0.147602),
        (0.004733, 0.691367, 0.303900),
    ),
}
#: CIE76: 2.3 is the least that is seen; side by side in the sun it takes more.
APART = 15.0
#: WCAG 2, level AA.
READABLE = 4.5


def linear(colour):
    parts = [int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    return [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]


def luminance(colour):
    return sum(w * p for w, p in zip((0.2126, 0.7152, 0.0722), linear(colour), strict=True))


def contrast(one, other):
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def lab(rgb):
    x, y, z = (
        sum(w * p for w, p in zip(row, rgb, strict=True))
        for row in (
            (0.4124, 0.3576, 0.1805),
            (0.2126, 0.7152, 0.0722),
            (0.0193, 0.1192, 0.9505),
        )
    )
    a, b, c = (
        v ** (1 / 3) if v > 0.008856 else 7.787 * v + 16 / 116 for v in (x / 0.9505, y, z / 1.089)
    )
    return 116 * b - 16, 500 * (a - b), 200 * (b - c)


@pytest.mark.parametrize("sight", SEEN)
@pytest.mark.parametrize(("one", "other"), itertools.combinations(TONES, 2))
def test_no_two_tones_look_alike(sight, one, other):
    looks = []
    for tone in (one, other):
        rgb = linear(TONES[tone].back)
        seen = [sum(w * p for w, p in zip(row, rgb, strict=True)) for row in SEEN[sight]]
        looks.append(lab([min(1.0, max(0.0, p)) for p in seen]))
    apart = sum((a - b) ** 2 for a, b in zip(*looks, strict=True)) ** 0.5
    assert apart >= APART, f"{one} and {other} are {apart:.1f} apart for {sight}"


@pytest.mark.parametrize("name", TONES)
def test_each_word_can_be_read_on_its_colour(name):
    assert contrast(TONES[name].back, TONES[name].ink) >= READABLE


def test_each_tone_has_a_sign_of_its_own():
    assert set(TONES) == set(NAMES)
    assert len({one.sign for one in TONES.values()}) == len(TONES)


def test_the_page_has_these_colours():
    text = (Path(vehicle_page.__file__).parent / "panel.css").read_text()
    rules = dict(re.findall(r"\.tone-(\w+) \{ (.*?) \}", text))
    told = {name: f"background: {t.back}; color: {t.ink};" for name, t in TONES.items()}
    assert rules == told
