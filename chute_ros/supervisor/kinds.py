"""Which texts say the same: what goes on is said once, however its figures change."""

from __future__ import annotations

import re

#: What is measured is written with its decimals; names and limits mostly have none.
_MEASURED = re.compile(r"\d+\.\d+")


def kind(text: str) -> str:
    """Without what was measured."""
    return _MEASURED.sub("#", text)
