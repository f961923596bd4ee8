"""What can stop the set-up, and the one line that says what to do about it.

Everything here is a pure function of facts handed in, so that each failure can be tested as a
story. The syntax is that of Python 3.6, so that an old interpreter gets the line about its
version instead of a SyntaxError.
"""

from typing import NamedTuple, Tuple

WHEEL_DISTROS = ("jazzy", "kilted")
OLDEST, NEWEST = (3, 10), (3, 13)
NEEDED_BYTES = 1500 * 1000 * 1000


class Problem(NamedTuple):
    what: str
    remedy: str

    def __str__(self):
        return f"chute_ros set-up: {self.what}: {self.remedy}"


class SetUpError(Exception):
    """Ends the set-up with one problem."""

    def __init__(self, what, remedy):
        super().__init__(what)
        self.problem = Problem(what, remedy)


class Host(NamedTuple):
    """What the checks look at; one value for each thing that can be wrong."""

    python: Tuple[int, ...]
    implementation: str
    system: str
    machine: str
    has_venv: bool
    has_headers: bool
    tools: Tuple[str, ...]
    writable: bool
    free_bytes: int


class Mode(NamedTuple):
    """Which ROS is used. `sourced` is the one the shell already has, otherwise wheels."""

    distro: str
    sourced: bool

    @property
    def name(self):
        return "sourced-" + self.distro if self.sourced else self.distro


def choose_mode(wanted, sourced_distro):
    """`wanted` is the DISTRO asked for or "", `sourced_distro` that of a usable ROS or ""."""
    if sourced_distro:
        if wanted and wanted != sourced_distro:
            raise SetUpError(
                f"DISTRO={wanted} was asked for, but ROS 2 {sourced_distro} is sourced here",
                "leave DISTRO out, or use a shell that has sourced no ROS",
            )
        return Mode(sourced_distro, True)
    distro = wanted or WHEEL_DISTROS[0]
    if distro not in WHEEL_DISTROS:
        raise SetUpError(
            f"no ROS 2 distribution {distro!r}",
            "use DISTRO=" + " or DISTRO=".join(WHEEL_DISTROS) + ", or source an installed ROS",
        )
    return Mode(distro, False)


def python_problem(host):
    """Apart from the others because nothing else may run on an interpreter that is too old."""
    version = ".".join(str(part) for part in host.python)
    if not OLDEST <= host.python[:2] <= NEWEST:
        return Problem(
            f"Python {version} is not one of 3.10 to 3.13",
            "name one that is, for example: make PYTHON=python3.12",
        )
    if host.implementation != "cpython":
        return Problem(
            f"{host.implementation} is not CPython",
            "name a CPython 3.10 to 3.13, for example: make PYTHON=/usr/bin/python3",
        )
    return None


def host_problem(host, mode):
    """The first thing missing on this machine that is needed even after the set-up."""
    if not mode.sourced and (host.system, host.machine) != ("Linux", "x86_64"):
        return Problem(
            f"this is {host.system} on {host.machine}, and ROS 2 wheels are for Linux on x86-64",
            "install ROS 2 for this machine, source its setup.bash, then run make again",
        )
    for tool, package in (("c++", "g++"), ("cc", "gcc"), ("cmake", "cmake"), ("make", "make")):
        if tool not in host.tools:
            name = {"c++": "C++ compiler", "cc": "C compiler"}.get(tool, tool)
            return Problem(f"no {name} found", f"install one, for example: apt install {package}")
    return None


def space_problem(host):
    """What is needed only while the environment is made."""
    python = "python{}.{}".format(*host.python[:2])
    if not host.has_venv:
        return Problem(
            f"{python} has no venv module with pip",
            f"install it, for example: apt install {python}-venv",
        )
    if not host.has_headers:
        return Problem(
            f"the C headers of {python} (Python.h) are missing and could not be fetched",
            f"install them, for example: apt install {python}-dev",
        )
    if not host.writable:
        return Problem(
            "the repository is not writable", "make it so, or clone it to a place of your own"
        )
    if host.free_bytes < NEEDED_BYTES:
        return Problem(
            f"only {host.free_bytes / 1e9:.1f} GB are free on this disk",
            f"free some: {NEEDED_BYTES / 1e9:.1f} GB are needed",
        )
    return None


# What pip, uv, apt and the system say, in the order in which they are looked for: a full disk
# may show as a broken download, a broken download as a missing version.
_SIGNS = (
    (
        ("No space left on device", "os error 28", "Errno 28", "Disk quota exceeded"),
        "the disk is full",
        f"free some space ({NEEDED_BYTES / 1e9:.1f} GB are needed) and run it again",
    ),
    (
        ("DO NOT MATCH THE HASHES", "Hash mismatch", "hash mismatch", "hashes must match"),
        "a package is not the one that was locked (its hash differs)",
        "try again; if it stays so, your package index or proxy serves altered files",
    ),
    (
        ("CERTIFICATE_VERIFY_FAILED", "invalid peer certificate"),
        "the certificate of the package index is not trusted",
        "set SSL_CERT_FILE and PIP_CERT to your proxy's certificates",
    ),
    (
        (
            "dns error",
            "Temporary failure in name resolution",
            "Name or service not known",
            "Failed to establish a new connection",
            "NewConnectionError",
            "ConnectTimeout",
            "ReadTimeout",
            "Read timed out",
            "Connection refused",
            "Connection reset",
            "Network is unreachable",
            "error sending request",
            "error trying to connect",
            "operation timed out",
            "ProxyError",
            "No matching distribution found for uv",
            "Failed to fetch",
            "Could not connect",
        ),
        "the package index cannot be reached",
        "check the network, and HTTPS_PROXY or pip's and uv's own settings if you use a proxy",
    ),
    (
        ("no wheels with a matching", "has no usable wheels", "is not a supported wheel"),
        "a locked package has no build for this Python and system",
        "use CPython 3.10 to 3.13 on a glibc Linux such as Debian 12 or Ubuntu 24.04",
    ),
    (
        ("Permission denied", "os error 13", "Read-only file system"),
        "a file could not be written",
        "check who owns the repository and the caches of pip and uv",
    ),
)


def explain(output, log):
    """The problem behind the output of an installer that failed; `log` holds all of it."""
    for signs, what, remedy in _SIGNS:
        if any(sign in output for sign in signs):
            return Problem(what, f"{remedy} (details: {log})")
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    last = lines[-1][:120] if lines else "it said nothing"
    return Problem(f"installing failed ({last})", f"see {log}")
