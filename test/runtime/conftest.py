"""What tests of the runtime share."""

from __future__ import annotations

import pytest
from runtime_shell import Shell


@pytest.fixture
def shell() -> Shell:
    return Shell()
