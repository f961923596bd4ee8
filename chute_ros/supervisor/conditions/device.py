"""What a device asks for or says of itself, as a condition."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from chute_ros.model import ParachuteState
from chute_ros.supervisor.conditions.base import Condition, Finding
from chute_ros.supervisor.yaml_lines import ANY, ProfileLines, Where

if TYPE_CHECKING:
    from chute_ros.supervisor.config import SupervisorConfig
    from chute_ros.supervisor.state import State


class DeviceFact(enum.Enum):
    """What can be true of a device on a link."""

    ASKS_FOR_KILL = "asks_for_kill"
    DEPLOYED = "deployed"
    ABNORMAL = "abnormal"
    #: No canopy at all, a drogue included, as far as anybody has told in this flight.
    NOTHING_OUT = "nothing_out"
    #: A drogue is out, and the parachute after it is not.
    DROGUE_OUT = "drogue_out"


@dataclass(frozen=True)
class DeviceCondition(Condition):
    """A device on this link (or any) is so."""

    fact: DeviceFact
    link: str = ANY
    weight: float = 1.0
    key: ClassVar = "device"
    borrowed: ClassVar = ("link",)
    is_silence: ClassVar = False

    @classmethod
    def parse(
        cls, lines: ProfileLines, what: str, where: Where, entries: dict[str, Where], weight: float
    ) -> DeviceCondition:
        """What the device does, and on which link."""
        fact = lines.member(entries["device"], f"device in {what}", DeviceFact)
        link = ANY
        if "link" in entries:
            link = lines.link(entries["link"], f"link in {what}", (ANY,))
        return cls(fact, link, weight)

    def find(self, config: SupervisorConfig, state: State, now: float) -> Finding:
        """Who does."""
        names = config.links if self.link == ANY else (self.link,)
        if self.fact is DeviceFact.ASKS_FOR_KILL:
            # One whose link is not among ours may ask all the same: to kill is the safe side.
            asks = [
                f"{who}: {ask.reason}"
                for who, ask in state.asking(now).items()
                if self.link == ANY or ask.link in names
            ]
            return Finding(bool(asks), lambda: "; ".join(asks) or "no device asks for a kill")
        if self.fact is DeviceFact.DEPLOYED:
            out = sorted(one for one in state.newly_released(config, now) if one[0] in names)

            def tell() -> str:
                who = ", ".join(" ".join(one) for one in out)
                return f"{who}: its own status says deployed" if out else "no parachute is out"

            return Finding(bool(out), tell)
        if self.fact is DeviceFact.DROGUE_OUT:
            under = [
                f"{name} {device} says LAUNCHED, and not deployed"
                for name in names
                for device, status in state.evidence(name).devices.items()
                if status.before_parachute
            ]
            return Finding(bool(under), lambda: "; ".join(under) or "no drogue alone is out")
        if self.fact is DeviceFact.NOTHING_OUT:
            # What came out stays out, however old the word is.
            canopies = [
                f"{name} {device} says LAUNCHED"
                for name in names
                for device, status in state.evidence(name).devices.items()
                if status.deployed or status.state is ParachuteState.LAUNCHED
            ]
            return Finding(not canopies, lambda: "; ".join(canopies) or "no canopy is out")
        wrong = [
            f"{name} {device} is ABNORMAL ({'; '.join(status.faults) or 'no reason given'})"
            for name in names
            for device, status in state.evidence(name).devices.items()
            if status.state is ParachuteState.ABNORMAL and state.hears(config, name, now)
        ]
        return Finding(bool(wrong), lambda: "; ".join(wrong) or "no device is ABNORMAL")

    def deadlines(
        self, config: SupervisorConfig, state: State, holds: bool | None, doubts: bool, now: float
    ) -> Iterable[float]:
        """When a wish for a kill is over."""
        if self.fact is not DeviceFact.ASKS_FOR_KILL:
            return ()
        return [ask.ends_at for ask in state.asks.values()]
