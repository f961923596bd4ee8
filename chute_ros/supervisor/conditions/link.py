"""How links are judged, as a condition."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

from chute_ros.supervisor.conditions.base import Condition, Finding
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.yaml_lines import ALL, ANY, ProfileLines, Where

if TYPE_CHECKING:
    from chute_ros.supervisor.config import SupervisorConfig
    from chute_ros.supervisor.state import State


@dataclass(frozen=True)
class LinkCondition(Condition):
    """A link, any or all of the required ones, is judged as one of these. Silence proves
    nothing about the vehicle: alone it never deploys."""

    link: str
    judged: tuple[LinkJudgement, ...]
    weight: float = 1.0
    key: ClassVar = "link"
    options: ClassVar = MappingProxyType({"is": "`is` belongs to a link"})
    is_silence: ClassVar = True

    @classmethod
    def parse(
        cls, lines: ProfileLines, what: str, where: Where, entries: dict[str, Where], weight: float
    ) -> LinkCondition | None:
        """Its link, and as what it is judged."""
        link = lines.link(entries["link"], f"link in {what}", (ANY, ALL))
        if "is" not in entries:
            text = f"a condition of {what} on a link needs `is`"
            lines.wrong(
                where.line, f"{text}: one or more of {', '.join(LinkJudgement.__members__)}"
            )
            return None
        judged = [
            LinkJudgement[lines.choice(one, f"is in {what}", LinkJudgement.__members__)]
            for one in lines.many(entries["is"], f"is in {what}")
        ]
        return cls(link, tuple(judged), weight)

    def find(self, config: SupervisorConfig, state: State, now: float) -> Finding:
        """Each of its links as it is judged now; one that is still starting is none of them."""
        looks, so = [], []
        for name in self._links(config):
            evidence, limits = state.evidence(name), config.limits(name)
            judged = evidence.judged(limits, now)
            in_grace = now < state.started_at + limits.startup_grace
            starting = judged is LinkJudgement.NEVER_SEEN and in_grace
            looks.append((name, judged, starting, evidence.heard))
            so.append(judged in self.judged and not starting)

        def tell() -> str:
            told = [
                f"{name} is still starting"
                if starting
                else f"{name} is {judged.name}, last received {now - heard:.2f} s ago"
                for name, judged, starting, heard in looks
            ]
            wanted = " or ".join(judgement.name for judgement in self.judged)
            return f"link {', '.join(told)} (asked for: {wanted})"

        return Finding(all(so) if self.link == ALL else any(so), tell)

    def deadlines(
        self, config: SupervisorConfig, state: State, holds: bool | None, doubts: bool, now: float
    ) -> Iterable[float]:
        """When its links should have started. Each link's own silence has deadlines anyhow."""
        graces = (config.limits(name).startup_grace for name in self._links(config))
        return [state.started_at + grace for grace in graces]

    def _links(self, config: SupervisorConfig) -> tuple[str, ...]:
        return config.required_links if self.link in (ANY, ALL) else (self.link,)
