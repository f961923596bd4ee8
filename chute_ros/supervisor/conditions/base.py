"""What every condition of a rule says of itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from chute_ros.supervisor.yaml_lines import ProfileLines, Where

if TYPE_CHECKING:  # both hold rules, which hold conditions
    from chute_ros.supervisor.config import SupervisorConfig
    from chute_ros.supervisor.state import State


#: A limit that an age may just reach has passed this much later, s.
JUST_AFTER = 1e-6


class Finding(NamedTuple):
    """holds None: it cannot be said. tell: says what was found, asked only where somebody reads
    it. samples: so many distinct ones came so far; -1: none do. doubted: the sensor that tells it
    has just told what cannot be. presumed: it is not known, and taken to be so."""

    holds: bool | None
    tell: Callable[[], str]
    samples: int = -1
    doubted: bool = False
    presumed: bool = False
    #: It does not hold, but goes on to where it did until the rule's counter was full.
    lingers: bool = False

    @property
    def text(self) -> str:
        """What was found, with its limit."""
        return self.tell()


class Condition(ABC):
    """One condition of a rule: a frozen dataclass that is named in CONDITIONS."""

    #: The key of a profile that names it.
    key: ClassVar[str]
    #: Its other keys, each with what is said where it stands at another kind of condition.
    options: ClassVar[Mapping[str, str]] = MappingProxyType({})
    #: Keys of other kinds that it reads as well.
    borrowed: ClassVar[tuple[str, ...]] = ()
    #: A profile may set counted.
    may_go_uncounted: ClassVar[bool] = False

    @property
    @abstractmethod
    def weight(self) -> float:
        """What it counts of what its rule needs."""

    @property
    def counted(self) -> bool:
        """The rule's counter goes up only with it."""
        return True

    @property
    @abstractmethod
    def is_silence(self) -> bool:
        """It tells only that somebody is not heard, or may: alone it never deploys."""

    @property
    def measured(self) -> tuple[str, ...]:
        """The measurements that it rests on."""
        return ()

    @property
    def rests_on_the_vehicle(self) -> bool:
        """What the vehicle tells, and time, are all that change it: nothing that we did."""
        return False

    @property
    def goes_on(self) -> bool:
        """It may go on to hold beyond its limit."""
        return False

    @classmethod
    @abstractmethod
    def parse(
        cls, lines: ProfileLines, what: str, where: Where, entries: dict[str, Where], weight: float
    ) -> Condition | None:
        """The condition that a profile asks for in entries; None: that cannot be told. what: the
        rule, in words; where: the condition in the file."""

    @abstractmethod
    def find(self, config: SupervisorConfig, state: State, now: float) -> Finding:
        """Whether it holds now, with its value and its limit in words."""

    @abstractmethod
    def deadlines(
        self, config: SupervisorConfig, state: State, holds: bool | None, doubts: bool, now: float
    ) -> Iterable[float]:
        """When time alone may have changed it, monotonic s; what is past does not count. Those of
        every link's silence are waited for without it. holds: of its rule; doubts: what is in
        doubt counts less there."""
