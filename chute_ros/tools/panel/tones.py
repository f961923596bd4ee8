"""Colours with a meaning, each with a sign of its own: nobody needs to tell the colours apart.

The tones are those of every picture of the suite (timeline_rows.py); these colours differ in
lightness as well, for people who see red and green alike, and for the sun.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tone:
    """back and ink: sRGB, of a word in large; sign: before the word."""

    back: str
    ink: str
    sign: str


TONES = {
    "good": Tone("#1b7f5c", "#ffffff", "●"),
    "live": Tone("#e06c1f", "#1d1600", "◆"),
    "plain": Tone("#8cc4f0", "#0b1d2a", "▲"),
    "warn": Tone("#f2c230", "#1d1600", "■"),
    "bad": Tone("#8f1220", "#ffffff", "✖"),
    "act": Tone("#5b2a86", "#ffffff", "▼"),
    "quiet": Tone("#8b949c", "#0f1418", "○"),
}
