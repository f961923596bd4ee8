"""Makes ROS 2 wheels fit the machine they were installed on, so that interfaces can be built.

The CMake files in the wheels name folders of the machine that built them. CPython's C headers,
which Debian and Ubuntu keep apart from python3, are fetched into the environment if need be.
"""

import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

from set_up_checks import SetUpError

_BUILD_HOST = "/opt/python/"
_INCLUDE = re.compile(r"/opt/python/[^/;\"]+/include/python[0-9.]+")
_SITE_PACKAGES = re.compile(r"/opt/python/[^/;\"]+/lib/python[0-9.]+/site-packages")


def rewrite_exports(venv, include, site_packages):
    """Point the wheels' exported CMake targets at this machine's headers; returns how many."""
    changed = 0
    for path in sorted(Path(venv, "share").glob("*/cmake/*.cmake")):
        text = path.read_text()
        if _BUILD_HOST not in text:
            continue
        text = _INCLUDE.sub(lambda _: str(include), text)
        text = _SITE_PACKAGES.sub(lambda _: str(site_packages), text)
        if _BUILD_HOST in text:
            raise SetUpError(
                f"{path} names a folder of the machine that built it",
                "report it, and go back to the last locks that worked: git checkout requirements",
            )
        # The file is a hard link into the installer's cache: a new one takes its place, so that
        # the cache stays as it was downloaded.
        new = path.with_name(path.name + ".new")
        new.write_text(text)
        os.replace(new, path)
        changed += 1
    return changed


def system_include():
    """Where this interpreter's own Python.h is, or None."""
    include = Path(sysconfig.get_config_var("INCLUDEPY"))
    return include if (include / "Python.h").is_file() else None


def can_fetch_headers():
    return all(shutil.which(tool) for tool in ("apt-get", "dpkg-deb"))


def fetch_headers(venv, version, run):
    """Unpack the distribution's header package into the environment; installs nothing.

    `version` is "3.11"; `run` runs a command with keyword arguments for subprocess.
    """
    scratch = Path(venv, "headers")
    lists = scratch / "lists"
    (lists / "partial").mkdir(parents=True)
    apt = ["apt-get", "-q", "-o", "APT::Sandbox::User=root"]
    download = ["download", f"libpython{version}-dev"]
    try:
        run(apt + download, cwd=str(scratch))
    except subprocess.CalledProcessError:
        # The machine's package lists are missing or old: take fresh ones, again of our own.
        apt += ["-o", f"Dir::State::Lists={lists}", "-o", f"Dir::Cache={scratch / 'cache'}"]
        (scratch / "cache" / "archives" / "partial").mkdir(parents=True)
        run([*apt, "update"], cwd=str(scratch))
        run(apt + download, cwd=str(scratch))
    for package in scratch.glob("*.deb"):
        run(["dpkg-deb", "-x", str(package), str(scratch / "root")])
    include = Path(venv, "include", f"python{version}")
    unpacked = scratch / "root" / "usr" / "include"
    shutil.copytree(str(unpacked / f"python{version}"), str(include), dirs_exist_ok=True)
    # Debian's pyconfig.h only forwards to the one of the processor, in a folder apart.
    for own in unpacked.glob(f"*/python{version}/pyconfig.h"):
        shutil.copy(str(own), str(include / "pyconfig.h"))
    shutil.rmtree(str(scratch))
    return include
