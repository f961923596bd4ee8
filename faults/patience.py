"""Looking at something that lives until it is as it must be, or for so long."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar


class Patient(ABC):
    """Who looks."""

    #: Raised where what must be does not come about.
    failure: ClassVar[type[Exception]]

    @abstractmethod
    def turn(self) -> None:
        """One look."""

    @abstractmethod
    def complaints(self) -> list[str]:
        """What is to be said of it now."""

    def until(self, seconds: float, condition: Callable[[], bool]) -> bool:
        """Look until condition holds, or for so long; whether it does."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() >= end:
                return False
            self.turn()
        return True

    def must(self, what: str, seconds: float, condition: Callable[[], bool]) -> None:
        """The same; failure if it does not."""
        if not self.until(seconds, condition):
            told = "; ".join(self.complaints())
            raise self.failure(f"{what}: not within {seconds:g} s ({told})")

    def rest(self, seconds: float) -> None:
        """Look on."""
        self.until(seconds, lambda: False)
