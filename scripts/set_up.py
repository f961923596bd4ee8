#!/usr/bin/env python3
"""Make the environment in which the packages are built, tested and run: set_up.py [DISTRO].

Prints the folder of the environment, .venv-<name>, on standard output and everything else on
standard error. <name> is a distribution whose wheels were installed (jazzy, kilted), or
sourced-<distribution> where the shell has sourced an installed ROS 2; then only what ROS does not
bring is installed. In that folder:

    local_setup.sh  to source: ROS and the tools; colcon's own setup files look for this name
    env.sh          to source: the same and, once built, our own packages
    set_up.done     written last, with a fingerprint of everything the environment was made from;
                    a folder without it, or with another fingerprint, is removed and made again

The syntax is that of Python 3.6: an old interpreter must get as far as saying that it is one.
"""

import fcntl
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import set_up_wheels as wheels
from set_up_checks import (
    Host,
    SetUpError,
    choose_mode,
    explain,
    host_problem,
    python_problem,
    space_problem,
)

ROOT = Path(__file__).resolve().parent.parent
DONE = "set_up.done"
SYSTEM_CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt"


def say(text):
    print(f"chute_ros set-up: {text}", file=sys.stderr, flush=True)


def base_python():
    """The interpreter outside any virtual environment, which may be the one being remade."""
    return getattr(sys, "_base_executable", None) or sys.executable


def look_at_host():
    python = sys.version_info
    return Host(
        python=tuple(python[:3]),
        implementation=sys.implementation.name,
        system=platform.system(),
        machine=platform.machine(),
        has_venv=all(importlib.util.find_spec(name) for name in ("venv", "ensurepip")),
        has_headers=bool(wheels.system_include()) or wheels.can_fetch_headers(),
        tools=tuple(
            tool
            for tool, override in (("c++", "CXX"), ("cc", "CC"), ("cmake", ""), ("make", ""))
            if shutil.which((os.environ.get(override) or tool).split()[0])
        ),
        writable=os.access(str(ROOT), os.W_OK),
        free_bytes=shutil.disk_usage(str(ROOT)).free,
    )


def sourced_distro():
    """The ROS distribution this shell has sourced, as far as a quick look tells, or ""."""
    distro = os.environ.get("ROS_DISTRO", "")
    # Inside one of our own wheel environments the variable is ours.
    ours = os.environ.get("CHUTE_ROS_ENV", "") == distro
    return distro if distro and not ours and importlib.util.find_spec("rclpy") else ""


def imports_rclpy():
    check = subprocess.run(
        [base_python(), "-c", "import rclpy"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=False,
    )
    return check.returncode == 0


def pick_environment(wanted_distro):
    """The mode, the folder of its environment and the fingerprint that it must have."""
    mode = choose_mode(wanted_distro, sourced_distro())
    venv = ROOT / f".venv-{mode.name}"
    wanted = fingerprint(mode, venv)
    # Importing takes its time; an environment that is complete has passed this check.
    if mode.sourced and not is_done(venv, wanted) and not imports_rclpy():
        mode = choose_mode(wanted_distro, "")
        venv = ROOT / f".venv-{mode.name}"
        wanted = fingerprint(mode, venv)
    return mode, venv, wanted


def fingerprint(mode, venv):
    """Changes whenever the environment would come out differently."""
    digest = hashlib.sha256()
    files = [f"requirements/{lock_name(mode)}", "requirements/installer.lock"]
    files += sorted(f"scripts/{path.name}" for path in (ROOT / "scripts").glob("set_up*.py"))
    for name in files:
        digest.update(f"\0{name}\0".encode() + (ROOT / name).read_bytes())
    digest.update(f"\0{sys.version}\0{sys.base_prefix}\0{venv}".encode())
    return digest.hexdigest()


def lock_name(mode):
    return "sourced.lock" if mode.sourced else mode.distro + ".lock"


def is_done(venv, wanted):
    try:
        return (venv / DONE).read_text() == wanted
    except OSError:
        return False


class Maker:
    """The steps that make one environment, in order."""

    def __init__(self, mode, venv, lock_file):
        self.mode = mode
        self.venv = venv
        self.lock_file = lock_file
        self.log = venv.with_name(venv.name + ".log")
        self.python = venv / "bin" / "python3"
        version = "python{}.{}".format(*sys.version_info[:2])
        self.site_packages = venv / "lib" / version / "site-packages"

    def make(self, wanted):
        start = time.monotonic()
        if self.venv.exists():
            why = "changed inputs" if (self.venv / DONE).exists() else "left half-made"
            say(f"{self.venv.name} is removed and made again: {why}")
            shutil.rmtree(str(self.venv))
        self.log.write_text("")
        steps = [
            ("create " + self.venv.name, self.create),
            ("fetch the installer", self.install_installer),
            (f"install requirements/{lock_name(self.mode)}", self.install_packages),
            ("fit it to this machine", self.fit),
            ("check it", self.check),
        ]
        for number, (title, step) in enumerate(steps, 1):
            began = time.monotonic()
            say(f"{number}/{len(steps)} {title} ...")
            step()
            say(f"{number}/{len(steps)} {title}: {time.monotonic() - began:.1f} s")
        new = self.venv / (DONE + ".new")
        new.write_text(wanted)
        os.replace(str(new), str(self.venv / DONE))
        say(f"done in {time.monotonic() - start:.1f} s")

    def run(self, command, pythonpath=None, **options):
        """Run a command quietly; its output goes to the log. Says now and then that it goes on.

        The command inherits the lock: should we be killed, the next set-up waits for its end
        instead of removing the folder under it.
        """
        env = dict(os.environ)
        for name in ("PYTHONHOME", "PYTHONPATH", "VIRTUAL_ENV"):
            env.pop(name, None)
        if env.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None):
            # We run in the Python of another environment, whose libraries these are.
            env.pop("LD_LIBRARY_PATH", None)
        if pythonpath:
            env["PYTHONPATH"] = pythonpath
        env.update(PIP_DISABLE_PIP_VERSION_CHECK="1", UV_PYTHON_DOWNLOADS="never")
        env.update(LC_ALL="C.UTF-8", UV_NO_PROGRESS="1")
        if os.path.exists(SYSTEM_CERTIFICATES):
            # uv brings its own, which know nothing of the certificate of a company's proxy.
            env.setdefault("UV_SYSTEM_CERTS", "1")
        with self.log.open("a") as log:
            begin = log.tell()
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=env,
                pass_fds=[self.lock_file.fileno()],
                **options,
            )
            began = time.monotonic()
            while True:
                try:
                    code = process.wait(timeout=10)
                    break
                except subprocess.TimeoutExpired:
                    say(f"... still at it after {time.monotonic() - began:.0f} s")
        if code:
            with self.log.open(errors="replace") as log:
                log.seek(begin)
                raise subprocess.CalledProcessError(code, command, log.read())

    def create(self):
        options = ["--system-site-packages"] if self.mode.sourced else []
        self.run([base_python(), "-m", "venv", *options, str(self.venv)])
        (self.venv / "COLCON_IGNORE").touch()

    def install_installer(self):
        pip = [str(self.python), "-m", "pip", "install", "--quiet", "--retries", "2"]
        lock = ROOT / "requirements" / "installer.lock"
        # One that the system has would count as installed, and its version is not ours.
        own = ["--ignore-installed", "--no-deps", "--require-hashes"]
        self.run([*pip, *own, "-r", str(lock)])

    def install_packages(self):
        lock = str(ROOT / "requirements" / lock_name(self.mode))
        uv = [str(self.venv / "bin" / "uv"), "pip", "install", "--python", str(self.python)]
        # The few packages without a wheel are built with the setuptools of the same lock.
        hashed = ["--require-hashes", "--build-constraints", lock, "-r", lock]
        # Where Python must not keep what it compiles, each start of a node took 0.4 s longer.
        self.run([*uv, "--compile-bytecode", *hashed])

    def fit(self):
        if not self.mode.sourced:
            include = wheels.system_include()
            if include is None:
                version = "{}.{}".format(*sys.version_info[:2])
                include = wheels.fetch_headers(self.venv, version, self.run)
            wheels.rewrite_exports(self.venv, include, self.site_packages)
        lines = underlay(self.mode, self.venv)
        (self.venv / "local_setup.sh").write_text("\n".join(lines) + "\n")
        for shell in ("bash", "zsh"):
            (self.venv / ("local_setup." + shell)).symlink_to("local_setup.sh")
        lines += overlay(ROOT / f"install-{self.mode.name}")
        (self.venv / "env.sh").write_text("\n".join(lines) + "\n")

    def check(self):
        modules = "import rclpy, em, lark, numpy, pymavlink, colcon_core"
        sourced_path = os.environ.get("PYTHONPATH") if self.mode.sourced else None
        self.run([str(self.python), "-c", modules], pythonpath=sourced_path)


def underlay(mode, venv):
    """Lines for any POSIX shell; sourced twice, or after another environment, they still hold."""
    lines = [
        "# Made by scripts/set_up.py, to be sourced.",
        f"export VIRTUAL_ENV={shlex.quote(str(venv))} CHUTE_ROS_ENV={mode.name}",
        'case "$PATH" in "$VIRTUAL_ENV/bin:"*) ;; *) export PATH="$VIRTUAL_ENV/bin:$PATH" ;; esac',
    ]
    if not mode.sourced:
        lines += [
            "unset PYTHONHOME PYTHONPATH",
            'export AMENT_PREFIX_PATH="$VIRTUAL_ENV" CMAKE_PREFIX_PATH="$VIRTUAL_ENV"',
            f"export ROS_DISTRO={mode.distro} ROS_VERSION=2 ROS_PYTHON_VERSION=3",
            "# The libraries of another distribution's overlay would be loaded instead of ours.",
            ': "${CHUTE_ROS_LIBRARIES=${LD_LIBRARY_PATH-}}"',
            'export CHUTE_ROS_LIBRARIES LD_LIBRARY_PATH="$CHUTE_ROS_LIBRARIES"',
        ]
    return lines


def overlay(install):
    """The same for our own packages, once they are built there; chute, report and the others are
    commands then. They come last in PATH: a command of the system keeps its name."""
    setup = shlex.quote(str(install / "local_setup.sh"))
    commands = shlex.quote(str(install / "chute_ros" / "lib" / "chute_ros"))
    return [
        f"if [ -f {setup} ]; then",
        f"    . {setup}",
        f'    case ":$PATH:" in *:{commands}:*) ;; *) export PATH="$PATH":{commands} ;; esac',
        "fi",
    ]


def set_up(wanted_distro):
    """Returns the folder of an environment that is complete."""
    host = look_at_host()
    problem = python_problem(host)
    if problem:
        raise SetUpError(*problem)
    mode, venv, wanted = pick_environment(wanted_distro)
    problem = host_problem(host, mode)
    if problem:
        raise SetUpError(*problem)
    if is_done(venv, wanted):
        return venv
    problem = space_problem(host)
    if problem:
        raise SetUpError(*problem)
    with open(str(venv) + ".lock", "w") as lock_file:
        try:
            fcntl.flock(lock_file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say(f"waiting for another set-up of {venv.name}")
            fcntl.flock(lock_file, fcntl.LOCK_EX)
        if not is_done(venv, wanted):
            maker = Maker(mode, venv, lock_file)
            try:
                maker.make(wanted)
            except subprocess.CalledProcessError as failure:
                output = failure.output
                if shutil.disk_usage(str(ROOT)).free < 20e6:
                    output = "No space left on device"  # nor was there any for saying so
                raise SetUpError(*explain(output, maker.log.name)) from failure
    return venv


def main():
    try:
        print(set_up(sys.argv[1] if len(sys.argv) > 1 else ""))
    except SetUpError as stop:
        print(stop.problem, file=sys.stderr)
        return 1
    except OSError as error:
        print(explain(str(error), error.filename or "nothing more is known"), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        say("interrupted; run it again to start over")
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
