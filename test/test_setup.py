"""The set-up: every way in which it can fail, and what it does after being cut off.

Nothing here downloads: the steps that would are replaced.
"""

import ast
import contextlib
import io
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import set_up
import set_up_checks as checks
import set_up_wheels as wheels
import test_totals

ROOT = Path(__file__).resolve().parents[1]
GOOD = checks.Host(
    python=(3, 11, 7),
    implementation="cpython",
    system="Linux",
    machine="x86_64",
    has_venv=True,
    has_headers=True,
    tools=("c++", "cc", "cmake", "make"),
    writable=True,
    free_bytes=10**10,
)
JAZZY = checks.Mode("jazzy", False)
SOURCED = checks.Mode("jazzy", True)


# What is checked before anything is done


@pytest.mark.parametrize("version", [(3, 10, 0), (3, 11, 7), (3, 12, 1), (3, 13, 0)])
def test_supported_pythons_pass(version):
    assert checks.python_problem(GOOD._replace(python=version)) is None


@pytest.mark.parametrize("version", [(3, 6, 9), (3, 9, 2), (3, 14, 0), (4, 0, 0)])
def test_other_pythons_are_named(version):
    problem = checks.python_problem(GOOD._replace(python=version))
    assert ".".join(map(str, version)) in str(problem)
    assert "make PYTHON=" in str(problem)


def test_another_implementation_of_python_is_named():
    assert "pypy" in str(checks.python_problem(GOOD._replace(implementation="pypy")))


def test_a_good_machine_has_no_problem():
    assert checks.host_problem(GOOD, JAZZY) is None
    assert checks.space_problem(GOOD) is None


@pytest.mark.parametrize(
    ("tool", "expected"),
    [
        ("c++", "no C++ compiler found: install one, for example: apt install g++"),
        ("cc", "no C compiler found: install one, for example: apt install gcc"),
        ("cmake", "no cmake found: install one, for example: apt install cmake"),
        ("make", "no make found: install one, for example: apt install make"),
    ],
)
@pytest.mark.parametrize("mode", [JAZZY, SOURCED])
def test_a_missing_tool_is_named(tool, expected, mode):
    host = GOOD._replace(tools=tuple(set(GOOD.tools) - {tool}))
    assert str(checks.host_problem(host, mode)) == "chute_ros set-up: " + expected


@pytest.mark.parametrize(("system", "machine"), [("Linux", "aarch64"), ("Darwin", "x86_64")])
def test_another_processor_or_system_needs_a_sourced_ros(system, machine):
    host = GOOD._replace(system=system, machine=machine)
    assert f"{system} on {machine}" in str(checks.host_problem(host, JAZZY))
    assert checks.host_problem(host, SOURCED) is None


@pytest.mark.parametrize(
    ("change", "what", "remedy"),
    [
        ({"has_venv": False}, "venv", "apt install python3.11-venv"),
        ({"has_headers": False}, "Python.h", "apt install python3.11-dev"),
        ({"writable": False}, "not writable", "clone"),
        ({"free_bytes": 400_000_000}, "only 0.4 GB", "1.5 GB are needed"),
    ],
)
def test_what_making_an_environment_needs_is_named(change, what, remedy):
    problem = checks.space_problem(GOOD._replace(**change))
    assert what in problem.what
    assert remedy in problem.remedy


# Which ROS


@pytest.mark.parametrize(
    ("wanted", "sourced", "name"),
    [
        ("", "", "jazzy"),
        ("jazzy", "", "jazzy"),
        ("kilted", "", "kilted"),
        ("", "jazzy", "sourced-jazzy"),
        ("rolling", "rolling", "sourced-rolling"),
    ],
)
def test_the_mode_follows_what_is_asked_for_and_what_is_sourced(wanted, sourced, name):
    assert checks.choose_mode(wanted, sourced).name == name


@pytest.mark.parametrize(("wanted", "sourced"), [("humble", ""), ("kilted", "jazzy")])
def test_a_distribution_that_cannot_be_had_is_named(wanted, sourced):
    with pytest.raises(checks.SetUpError) as caught:
        checks.choose_mode(wanted, sourced)
    assert wanted in str(caught.value.problem)


def test_our_own_environment_is_not_taken_for_a_sourced_ros(monkeypatch):
    monkeypatch.setenv("ROS_DISTRO", "kilted")
    monkeypatch.setenv("CHUTE_ROS_ENV", "kilted")
    assert set_up.sourced_distro() == ""


# What the installers say; each text is cut from a real run


@pytest.mark.parametrize(
    ("output", "what"),
    [
        ("OSError: [Errno 28] No space left on device", "the disk is full"),
        (
            "error: Failed to fetch: `x`\n  cause: No space left on device (os error 28)",
            "the disk is full",
        ),
        ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "its hash"),
        ("  cause: Hash mismatch for `pyserial==3.5`\n\nExpected:\n  sha256:00", "its hash"),
        (
            "NewConnectionError: [Errno 111]\nERROR: No matching distribution found for uv==1.0",
            "cannot be reached",
        ),
        ("error: Request failed after 3 retries\n  cause: dns error", "cannot be reached"),
        (
            "  cause: Because ros-rclpy==7.1.6 has no wheels with a matching platform tag",
            "no build for this Python",
        ),
        ("error: failed to create directory: Permission denied (os error 13)", "written"),
        ("  cause: invalid peer certificate: UnknownIssuer", "certificate"),
        ("Traceback\nSomethingNew: it broke", "SomethingNew: it broke"),
        ("", "it said nothing"),
    ],
)
def test_a_failed_installer_is_explained_in_one_line(output, what):
    text = str(checks.explain(output, "the.log"))
    assert what in text
    assert "the.log" in text
    assert "\n" not in text


# What a shell has that sourced the environment

#: What a person runs, by the name under which setup.py installs it.
COMMANDS = ["chute", "panel", "report", "replay", "to_rosbag2", "judge_log", "demo", "campaign"]
NEEDS_ENVIRONMENT = pytest.mark.skipif(
    not os.environ.get("CHUTE_ROS_ENV"), reason="not in an environment of make"
)


def shell(script, path=os.defpath):
    """What a new shell prints."""
    clean = {"PATH": path, "HOME": os.environ.get("HOME", "/")}
    command = ["sh", "-ec", script]
    done = subprocess.run(command, env=clean, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


@NEEDS_ENVIRONMENT
def test_the_commands_of_a_person_are_found_once_the_environment_is_sourced():
    venv = Path(os.environ["VIRTUAL_ENV"])
    installed = venv.parent / f"install-{os.environ['CHUTE_ROS_ENV']}/chute_ros/lib/chute_ros"
    found = shell(f". {venv}/env.sh; for one in {' '.join(COMMANDS)}; do command -v $one; done")
    assert found == [str(installed / one) for one in COMMANDS]


@NEEDS_ENVIRONMENT
def test_chute_runs_as_the_command_that_the_guide_names():
    said = shell(f". {os.environ['VIRTUAL_ENV']}/env.sh; chute --help")
    assert said[0].startswith("usage: chute ")


def test_a_command_of_the_system_keeps_its_name(tmp_path):
    install, system = tmp_path / "in stall", tmp_path / "system"
    ours = install / "chute_ros" / "lib" / "chute_ros"
    for folder, names in ((ours, ("chute", "report")), (system, ("report",))):
        folder.mkdir(parents=True)
        for name in names:
            (folder / name).write_text("#!/bin/sh\n")
            (folder / name).chmod(0o755)
    lines = "\n".join(set_up.overlay(install))
    path = f"{system}:{os.defpath}"
    assert shell(f"{lines}\necho $PATH", path) == [path], "before it is built"
    (install / "local_setup.sh").touch()
    found = shell(f"{lines}\n{lines}\ncommand -v chute; command -v report; echo $PATH", path)
    assert found == [str(ours / "chute"), str(system / "report"), f"{path}:{ours}"]


# The environment's folder


class FakeMaker(set_up.Maker):
    """Makes an environment of one file, without any download."""

    def create(self):
        self.venv.mkdir()
        (self.venv / "COLCON_IGNORE").touch()

    def install_installer(self):
        pass

    def install_packages(self):
        (self.venv / "package").write_text("whole")

    def fit(self):
        pass

    def check(self):
        pass


@pytest.fixture
def repo(tmp_path, monkeypatch):
    """A stand-in for the repository, in which set_up makes fake environments."""
    for name in ("requirements", "scripts"):
        shutil.copytree(ROOT / name, tmp_path / name)
    monkeypatch.setattr(set_up, "ROOT", tmp_path)
    monkeypatch.setattr(set_up, "Maker", FakeMaker)
    monkeypatch.setattr(set_up, "look_at_host", lambda: GOOD)
    monkeypatch.setattr(set_up, "sourced_distro", lambda: "")
    return tmp_path


def test_the_second_run_does_and_says_nothing(repo, capsys):
    venv = set_up.set_up("")
    assert venv == repo / ".venv-jazzy"
    assert "5/5" in capsys.readouterr().err
    (venv / "mine").touch()
    assert set_up.set_up("") == venv
    assert capsys.readouterr().err == ""
    assert (venv / "mine").exists()


@pytest.mark.parametrize("changed", ["requirements/jazzy.lock", "scripts/set_up.py"])
def test_changed_inputs_make_it_again(repo, capsys, changed):
    stale = set_up.set_up("") / "stale"
    stale.touch()
    with (repo / changed).open("a") as file:
        file.write("# changed\n")
    set_up.set_up("")
    assert "made again: changed inputs" in capsys.readouterr().err
    assert not stale.exists()


def test_another_lock_than_its_own_does_not(repo):
    kept = set_up.set_up("") / "kept"
    kept.touch()
    (repo / "requirements" / "kilted.lock").write_text("")
    set_up.set_up("")
    assert kept.exists()


@pytest.mark.parametrize("step", ["create", "install_installer", "install_packages", "check"])
def test_an_interrupted_one_is_noticed_and_made_again(repo, capsys, monkeypatch, step):
    def interrupted(maker):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(FakeMaker, step, interrupted)
        with pytest.raises(KeyboardInterrupt):
            set_up.set_up("")
    (repo / ".venv-jazzy").mkdir(exist_ok=True)
    (repo / ".venv-jazzy" / "package").write_text("ha")
    capsys.readouterr()
    venv = set_up.set_up("")
    said = capsys.readouterr().err
    assert said.count("left half-made") == 1
    assert (venv / "package").read_text() == "whole"


def test_a_failing_installer_ends_in_its_explanation(repo, monkeypatch):
    script = "echo 'cause: dns error'; exit 2"
    monkeypatch.setattr(FakeMaker, "install_packages", lambda self: self.run(["sh", "-c", script]))
    with pytest.raises(checks.SetUpError) as caught:
        set_up.set_up("")
    assert "cannot be reached" in str(caught.value.problem)
    assert "dns error" in (repo / ".venv-jazzy.log").read_text()


def test_after_a_kill_the_next_run_waits_for_the_orphaned_installer(tmp_path):
    # The first run is killed while its installer works on; the second may not touch the folder
    # before that installer has ended.
    ended = tmp_path / "ended"
    program = (
        "import sys, pathlib, set_up\n"
        f"lock = open({str(tmp_path / 'lock')!r}, 'w')\n"
        "set_up.fcntl.flock(lock, set_up.fcntl.LOCK_EX)\n"
        "mode = set_up.choose_mode('', '')\n"
        f"maker = set_up.Maker(mode, pathlib.Path({str(tmp_path)!r}), lock)\n"
        f"maker.run(['sh', '-c', 'echo ready >&7; sleep 0.7; touch {ended}'])\n"
    )
    ready, ready_end = os.pipe()
    program = program.replace(">&7", f">/proc/{os.getpid()}/fd/{ready_end}")
    env = {**os.environ, "PYTHONPATH": str(ROOT / "scripts")}
    first = subprocess.Popen([sys.executable, "-c", program], env=env)
    assert os.read(ready, 5) == b"ready"
    first.send_signal(signal.SIGKILL)
    first.wait()
    os.close(ready)
    os.close(ready_end)
    assert not ended.exists()
    with (tmp_path / "lock").open("w") as lock:
        set_up.fcntl.flock(lock, set_up.fcntl.LOCK_EX)
        assert ended.exists()


# The wheels


def test_exports_are_rewritten_and_the_cache_behind_a_hard_link_is_not(tmp_path):
    folder = tmp_path / "venv" / "share" / "std_msgs" / "cmake"
    folder.mkdir(parents=True)
    cached = tmp_path / "cached.cmake"
    old = (
        'INCLUDES "/opt/python/cp311-cp311/include/python3.11;'
        '/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include"'
    )
    cached.write_text(old)
    os.link(cached, folder / "Export.cmake")
    (folder / "other.cmake").write_text("nothing of it")
    assert wheels.rewrite_exports(tmp_path / "venv", "/inc", "/site") == 1
    rewritten = (folder / "Export.cmake").read_text()
    assert rewritten == 'INCLUDES "/inc;/site/numpy/_core/include"'
    assert cached.read_text() == old


def test_a_path_that_is_not_known_in_the_wheels_is_reported(tmp_path):
    folder = tmp_path / "share" / "std_msgs" / "cmake"
    folder.mkdir(parents=True)
    (folder / "Export.cmake").write_text("/opt/python/cp311-cp311/lib/libpython.so")
    with pytest.raises(checks.SetUpError, match=r"Export\.cmake"):
        wheels.rewrite_exports(tmp_path, "/inc", "/site")


# The commands themselves


@pytest.mark.parametrize("script", sorted((ROOT / "scripts").glob("set_up*.py")))
def test_an_old_python_can_read_the_scripts(script):
    ast.parse(script.read_text(), feature_version=(3, 7))


def run(command, repo, **env):
    base = {"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/")}
    return subprocess.run(
        command, cwd=repo, env={**base, **env}, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("arguments", "path", "expected"),
    [
        (["humble"], os.environ["PATH"], "no ROS 2 distribution 'humble'"),
        ([], "/nonexistent", "no C++ compiler found"),
    ],
)
def test_the_script_says_one_line_and_fails(tmp_path, arguments, path, expected):
    for name in ("requirements", "scripts"):
        shutil.copytree(ROOT / name, tmp_path / name)
    python = set_up.base_python()
    result = run([python, "scripts/set_up.py", *arguments], tmp_path, PATH=path)
    assert result.returncode == 1
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("chute_ros set-up: " + expected)


def test_make_without_any_python_says_one_line(tmp_path):
    shutil.copy(ROOT / "Makefile", tmp_path)
    result = run(["make", "build", "PYTHON=no-such-python"], tmp_path)
    assert result.returncode != 0
    own = [line for line in result.stderr.splitlines() if not line.startswith("make:")]
    assert len(own) == 1
    assert own[0].startswith("chute_ros set-up: no no-such-python found")


def test_locks_name_no_host_and_hash_every_package():
    for lock in (ROOT / "requirements").glob("*.lock"):
        text = lock.read_text()
        assert "://" not in text, lock
        packages = [line for line in text.splitlines() if line and not line.startswith((" ", "#"))]
        assert packages, lock
        assert all("==" in line and line.endswith("\\") for line in packages), lock


# The totals


CASES = {
    "passed": '<testcase name="a"/>',
    "failed": '<testcase name="b"><failure/></testcase>',
    "error": '<testcase name="c"><error/></testcase>',
    "skipped": '<testcase name="d"><skipped/></testcase>',
}


@pytest.mark.parametrize(
    ("results", "last_line", "code"),
    [
        ([["passed"], ["passed", "skipped"]], "2 passed, 0 failed, 1 skipped", 0),
        ([["passed", "failed"], ["passed"]], "2 passed, 1 failed, 0 skipped", 1),
        ([["error"], ["passed"]], "1 passed, 1 failed, 0 skipped", 1),
        ([["passed"], None], "1 passed, 1 failed, 0 skipped", 1),
        ([["skipped"], ["passed"]], "1 passed, 1 failed, 1 skipped", 1),
    ],
)
def test_the_last_line_holds_the_totals(tmp_path, results, last_line, code):
    names = ("pytest.xml", "test_results/two/contracts.xunit.xml")
    for package, name, cases in zip(("one", "two"), names, results, strict=True):
        file = tmp_path / package / name
        file.parent.mkdir(parents=True)
        if cases is not None:
            inside = "".join(CASES[case] for case in cases)
            file.write_text(f"<testsuites><testsuite>{inside}</testsuite></testsuites>")
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert test_totals.main(tmp_path, "one", "two") == code
    assert out.getvalue().splitlines()[-1] == last_line


def test_the_second_run_asks_nobody_for_real(tmp_path):
    """Given tools that fail, no other program, no cache and no network."""
    # Only where this very clone was set up by make; elsewhere there is nothing to be quick about.
    venv = ROOT / (".venv-" + os.environ.get("CHUTE_ROS_ENV", "none"))
    if not (venv / set_up.DONE).exists():
        pytest.skip("not run inside an environment of this clone")
    distro = os.environ["CHUTE_ROS_ENV"].replace("sourced-", "")
    for name in ("cc", "c++", "cmake", "make"):
        (tmp_path / name).write_text("#!/bin/sh\nexit 1\n")
        (tmp_path / name).chmod(0o755)
    result = subprocess.run(
        [set_up.base_python(), str(ROOT / "scripts" / "set_up.py"), distro],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": str(tmp_path), "HOME": str(tmp_path), "ALL_PROXY": "http://127.0.0.1:9"},
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, f"{venv}\n", "")
