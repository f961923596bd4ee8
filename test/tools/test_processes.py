"""Child processes: watched while they run, shown when they fail, and all ended."""

import os
import textwrap

import pytest

from chute_ros.tools.processes import ProcessEndedError, Processes


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where small modules of the test's own can be started from."""
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    )
    return tmp_path


@pytest.fixture
def processes(folder):
    one = Processes(folder)
    yield one
    one.end()


def module(folder, name, text):
    (folder / f"{name}.py").write_text(textwrap.dedent(text))


WAITS = """
    import signal, sys
    try:
        print("ready with", sys.argv[1:], flush=True)
        signal.pause()
    except KeyboardInterrupt:
        print("ended", flush=True)
"""
STUBBORN = """
    import signal
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print("ready", flush=True)
    while True:
        signal.pause()
"""
FAILS = """
    import sys
    for line in range(40):
        print("line", line)
    sys.exit("it broke")
"""


def test_one_runs_until_it_is_told_to_end(folder, processes, await_until):
    module(folder, "waits", WAITS)
    processes.start("mine", "waits", "--one", "two")
    await_until(lambda: "]\n" in processes.log("mine").read_text(), "it runs")
    processes.check()
    assert processes.names() == ["mine"]
    processes.end()
    text = processes.log("mine").read_text().splitlines()
    assert text == ["ready with ['--one', 'two']", "ended"]


def test_one_that_ends_by_itself_is_told_with_its_last_words(folder, processes, await_until):
    module(folder, "fails", FAILS)
    processes.start("mine", "fails")
    await_until(lambda: processes._running["mine"].poll() is not None, "it ends")
    with pytest.raises(ProcessEndedError) as caught:
        processes.check()
    text = str(caught.value)
    assert "mine ended with code 1" in text
    assert text.endswith("    mine: it broke")
    assert "line 39" in text
    assert "line 20" not in text, "only the end of it"


def test_a_child_that_does_not_listen_is_killed(folder, processes, await_until, monkeypatch):
    monkeypatch.setattr("chute_ros.tools.processes.END_TIMEOUT", 0.1)
    module(folder, "stubborn", STUBBORN)
    processes.start("mine", "stubborn")
    await_until(lambda: "ready" in processes.log("mine").read_text(), "it runs")
    processes.end()
    assert processes._running["mine"].returncode == -9
