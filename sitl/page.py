from dataclasses import dataclass
from sitl.judge import Verdict
@dataclass(frozen=True)
class Flown:
    kind: str
    version: str
    story: str
    text: str
    verdict: Verdict
def with_autopilot(page, flown): return page
