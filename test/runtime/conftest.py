"""What tests of the runtime share."""

import pytest
from runtime_shell import Shell


@pytest.fixture
def shell() -> Shell:
    return Shell()
