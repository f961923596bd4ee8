"""Who may give orders: a password, sessions, and a wait for each wrong password.

Pure: the time and the tokens come in.
"""

from __future__ import annotations

import hmac
import ipaddress
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass

from chute_ros.errors import ChuteError

#: A session ends so long after its login, s: a day in the field.
SESSION_LASTS = 12 * 3600.0
MOST_SESSIONS = 50
#: Wrong passwords of one address that cost nothing; each one after them doubles its wait, s.
FREE_MISTAKES = 3
FIRST_WAIT, LONGEST_WAIT = 2.0, 300.0
#: Of all addresses together, tries in this time, s; who guesses may have many addresses.
MOST_TRIES, TRIES_WITHIN = 30, 60.0
#: Addresses whose mistakes are remembered.
MOST_ADDRESSES = 1000
LONGEST_NAME = 40
LONGEST_PASSWORD = 1024


class AccessRefusedError(ChuteError):
    """A login that was not accepted; the text is for the person."""


@dataclass(frozen=True)
class Operator:
    """Who has logged in, by the name that they gave, from which address; until: monotonic s."""

    name: str
    address: str
    until: float

    @property
    def text(self) -> str:
        """For the record."""
        return f"{self.name} at {self.address} (panel)"


class Access:
    """password: None: nobody can log in. make_token: a new secret, which nobody can guess."""

    def __init__(self, password: str | None, make_token: Callable[[], str]) -> None:
        self._password = None if password is None else password.encode()
        self._make_token = make_token
        self._sessions: OrderedDict[str, Operator] = OrderedDict()
        #: Address -> (mistakes, refused until).
        self._mistakes: OrderedDict[str, tuple[int, float]] = OrderedDict()
        #: Of wrong passwords, of all addresses.
        self._tries: deque[float] = deque(maxlen=MOST_TRIES)
        #: Networks from which somebody has logged in: strangers who guess do not shut them out.
        self._known: OrderedDict[str, None] = OrderedDict()

    @property
    def is_possible(self) -> bool:
        """There is a password."""
        return self._password is not None

    def log_in(self, name: str, password: str, address: str, now: float) -> str:
        """The token of a new session. AccessRefusedError: the reason why not."""
        if self._password is None:
            raise AccessRefusedError("nobody can log in: the panel has no password_file")
        name = " ".join(name.split())
        if not 1 <= len(name) <= LONGEST_NAME:
            raise AccessRefusedError(
                f"need your name, 1 to {LONGEST_NAME} characters: it goes into the record"
            )
        key = _network_of(address)
        self._be_patient(key, now)
        given = password.encode(errors="replace")[:LONGEST_PASSWORD]
        if not hmac.compare_digest(given, self._password):
            self._tries.append(now)
            self._remember_mistake(key, now)
            raise AccessRefusedError("wrong password")
        self._mistakes.pop(key, None)
        self._known[key] = None
        while len(self._known) > MOST_ADDRESSES:
            self._known.popitem(last=False)
        token = self._make_token()
        self._sessions[token] = Operator(name, address, now + SESSION_LASTS)
        while len(self._sessions) > MOST_SESSIONS:
            self._sessions.popitem(last=False)
        return token

    def person(self, token: str | None, address: str, now: float) -> Operator | None:
        """Whose session this is; None: nobody's, or it has ended. It is of the network in which it
        began: a cookie that went astray is of no use elsewhere."""
        person = self._sessions.get(token or "")
        if person is not None and _network_of(person.address) != _network_of(address):
            return None
        if person is not None and now >= person.until:
            del self._sessions[token or ""]
            return None
        return person

    def log_out(self, token: str | None) -> None:
        """End this session."""
        self._sessions.pop(token or "", None)

    def _be_patient(self, key: str, now: float) -> None:
        _, until = self._mistakes.get(key, (0, now))
        many = len(self._tries) == MOST_TRIES and now < self._tries[0] + TRIES_WITHIN
        if many and key not in self._known:
            until = max(until, self._tries[0] + TRIES_WITHIN)
        if now < until:
            # Also with the right password: the answer must tell nothing of it.
            raise AccessRefusedError(f"too many wrong passwords: try again in {until - now:.0f} s")

    def _remember_mistake(self, key: str, now: float) -> None:
        mistakes = self._mistakes.pop(key, (0, 0.0))[0] + 1
        beyond = mistakes - FREE_MISTAKES
        # 2.0 ** is bounded: a guesser of months must not end in an OverflowError.
        wait = min(LONGEST_WAIT, FIRST_WAIT * 2.0 ** min(beyond, 20)) if beyond >= 0 else 0.0
        self._mistakes[key] = (mistakes, now + wait)
        while len(self._mistakes) > MOST_ADDRESSES:
            self._mistakes.popitem(last=False)


def _network_of(address: str) -> str:
    """Who has one address of IPv6 has 2^64 of them."""
    try:
        given = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if given.version == 4:
        return str(given)
    mapped = given.ipv4_mapped
    return str(mapped or ipaddress.ip_network(f"{given}/64", strict=False))
