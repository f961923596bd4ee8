"""The campaign on a Dask cluster of real processes: the same flights whatever becomes of them."""

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from dask_bench import dask_bench

import chute_ros
from chute_ros.campaign import campaign as flights
from chute_ros.campaign.checkpoint import text_of
from chute_ros.campaign.pool import flown_here
from chute_ros.campaign.shipped import Shipped
from chute_ros.errors import CampaignError
from chute_ros.ros.config_folder import config_folder
from chute_ros.tools import campaign_cluster, campaign_command

SEEDS, BUNDLE = range(100, 114), 2
PACKAGE = Path(chute_ros.__file__).parent


@pytest.fixture
def cluster():
    """Two workers, and a scheduler."""
    with dask_bench() as bench:
        for _ in range(2):
            bench.start_worker()
        yield bench


@pytest.fixture(autouse=True)
def small_bundles(monkeypatch):
    """Many, of a few flights."""
    monkeypatch.setattr(campaign_cluster, "_BUNDLE", BUNDLE)


@pytest.fixture
def nothing_flies(monkeypatch):
    """What flies now raises."""
    monkeypatch.setattr(flights, "run", None)


@pytest.fixture(scope="module")
def by_one_process():
    profiles = config_folder() / "profiles"
    flown = flown_here(partial(flights.fly_bundle, profiles), Shipped(profiles), SEEDS, 1)
    return kept(flights.run(flown, lambda _: None, flights.Tally()))


def kept(tally):
    """All that is counted and measured, to the last digit, but the time that it took."""
    tally.took = 0.0
    return text_of(tally, SEEDS[0], "")


def run(monkeypatch, *arguments):
    """The command; its exit code."""
    monkeypatch.setattr(sys, "argv", ["campaign", *arguments])
    try:
        campaign_command.main()
    except SystemExit as ended:
        return ended.code
    return 0


def test_a_worker_that_dies_costs_its_bundle_again_and_nothing_else(cluster, by_one_process):
    flown = campaign_cluster.Cluster(cluster.address)
    with contextlib.closing(flown):
        assert flown.workers == 2
        died = []

        def look(tally):
            if tally.flights == 4:
                cluster.start_worker()
                address, process = next(iter(cluster.workers.items()))
                assert flown._client.processing()[address], "it flies"
                process.kill()
                died.append(address)

        tally = flights.run(flown.flown(SEEDS), look, flights.Tally())
        steps = flown._client.run_on_scheduler(
            lambda dask_scheduler: [one[1:3] for one in dask_scheduler.transition_log]
        )
        left = flown._client.scheduler_info()["workers"]
    assert died
    assert died[0] not in left
    assert kept(tally) == by_one_process
    assert steps.count(("processing", "released")) > 0, "it died with a bundle"
    bundles, done = len(SEEDS) // BUNDLE, steps.count(("processing", "memory"))
    assert bundles <= done <= bundles + 1, "one more, if it died with a result on its way"


def test_after_the_scheduler_died_the_flights_go_on_at_another(
    cluster, by_one_process, monkeypatch, tmp_path, capsys
):
    file, pages = tmp_path / "kept.json", []
    options = [
        *("--seed", str(SEEDS[0]), "--flights", str(len(SEEDS)), "--resume", str(file)),
        *("--failures", str(tmp_path), "--page", str(tmp_path / "page.md"), "--scheduler"),
    ]
    look = campaign_command._Progress.look

    def killing(progress, tally):
        look(progress, tally)
        if tally.flights == 4:
            cluster.scheduler.kill()

    monkeypatch.setattr(campaign_command._Progress, "look", killing)
    told = run(monkeypatch, *options, cluster.address)
    assert told == (
        f"campaign: the scheduler at {cluster.address} is gone; the flights until then are "
        "reported, and --resume FILE continues from them"
    )
    first = re.search(rf"^(\d+) of {len(SEEDS)} flights in", capsys.readouterr().out, re.M)
    assert 4 <= int(first[1]) < len(SEEDS)
    monkeypatch.setattr(campaign_command._Progress, "look", look)
    monkeypatch.setattr(flights.Tally, "__eq__", None)
    monkeypatch.setattr(
        campaign_command, "page", lambda tally, *_: pages.append(kept(tally)) or "# page\n\n"
    )
    with dask_bench() as another:
        another.start_worker()
        assert run(monkeypatch, *options, another.address) == 0
    assert f"continuing after {first[1]} flights" in capsys.readouterr().err
    assert pages == [by_one_process]


def copied(folder, change):
    """An environment in which the package is another; change: with which file."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, folder / "chute_ros", ignore=ignored)
    shutil.copytree(config_folder(), folder / "config")
    if (PACKAGE.parent / "msg_defs").is_dir():
        (folder / "msg_defs").symlink_to(PACKAGE.parent / "msg_defs")
    with (folder / change).open("a") as file:
        file.write("\n# Another.\n")
    return {"PYTHONPATH": f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("chute_ros/supervisor/core.py", r"its code is [0-9a-f]{12}, the campaign's is [0-9a-f]"),
        ("config/profiles/multirotor.yaml", r"its profiles is [0-9a-f]{12}, the campaign's is "),
    ],
)
def test_a_worker_that_differs_is_named_before_anything_is_flown(
    change, words, nothing_flies, monkeypatch, tmp_path, capsys
):
    with dask_bench() as bench:
        bench.start_worker()
        other = bench.start_worker(**copied(tmp_path, change))
        assert run(monkeypatch, "--scheduler", bench.address) == 2
    out, err = capsys.readouterr()
    assert not out
    assert re.fullmatch(rf"campaign: worker {other}: {words}.*\n", err), err
    assert "install the same on both (docs/guide/cluster.md)" in err


def test_a_worker_of_two_threads_is_refused(nothing_flies, monkeypatch, capsys):
    with dask_bench() as bench:
        other = bench.start_worker("--nthreads", "2")
        assert run(monkeypatch, "--scheduler", bench.address) == 2
    told = f"worker {other}: it runs 2 threads: start it with --nthreads 1 --nworkers N"
    assert capsys.readouterr().err == f"campaign: {told}\n"


@pytest.mark.parametrize("where", ["worker", "scheduler"])
def test_one_without_the_code_is_named(where, nothing_flies, monkeypatch, capsys, tmp_path):
    (tmp_path / "chute_ros").mkdir()
    (tmp_path / "chute_ros" / "__init__.py").write_text("")
    without = {"PYTHONPATH": f"{tmp_path}{os.pathsep}{os.environ['PYTHONPATH']}"}
    with dask_bench(**(without if where == "scheduler" else {})) as bench:
        worker = bench.start_worker(**(without if where == "worker" else {}))
        named = worker if where == "worker" else bench.address
        assert run(monkeypatch, "--scheduler", bench.address) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"campaign: {where} {named}: ModuleNotFoundError")
    assert "No module named 'chute_ros." in told
    assert told.endswith("install the same on both (docs/guide/cluster.md)\n")


def test_a_worker_that_comes_later_and_differs_ends_it(cluster, tmp_path):
    other = []

    def look(tally):
        if tally.flights == 1:
            changed = copied(tmp_path, "chute_ros/supervisor/core.py")
            other.append(cluster.start_worker(**changed))
            for address in list(cluster.workers)[:2]:
                cluster.workers[address].kill()

    tally = flights.Tally()
    flown = campaign_cluster.Cluster(cluster.address)
    with contextlib.closing(flown), pytest.raises(CampaignError) as ended:
        flights.run(flown.flown(SEEDS), look, tally)
    assert str(ended.value).startswith(f"worker {other[0]}: its code is ")
    assert 1 <= tally.flights < len(SEEDS)


def test_a_scheduler_without_workers_is_told_with_the_remedy(nothing_flies, monkeypatch, capsys):
    monkeypatch.setattr(campaign_cluster, "_PATIENCE", 5.0)
    with dask_bench() as bench:
        assert run(monkeypatch, "--scheduler", bench.address) == 2
    told = capsys.readouterr().err
    assert told == (
        f"campaign: the scheduler at {bench.address} has no workers after 5 s: start some with "
        f"`dask worker {bench.address} --nthreads 1 --nworkers N` (docs/guide/cluster.md)\n"
    )


@contextlib.contextmanager
def nobody():
    """A port at which nobody listens; held, so that no other test's server comes to it."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        yield held.getsockname()[1]


@contextlib.contextmanager
def silent():
    """A port at which something listens that never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@contextlib.contextmanager
def worker():
    """The port of a worker, which answers as well."""
    with dask_bench() as bench:
        yield bench.start_worker().rpartition(":")[2]


@pytest.mark.parametrize("port", [nobody, silent, worker])
def test_where_no_scheduler_is_it_is_told_with_the_remedy(
    nothing_flies, port, monkeypatch, capsys
):
    monkeypatch.setattr(campaign_cluster, "_PATIENCE", 1.0)
    with port() as number:
        assert run(monkeypatch, "--scheduler", f"tcp://127.0.0.1:{number}") == 2
    told = capsys.readouterr().err
    assert re.fullmatch(
        rf"campaign: no scheduler at tcp://127.0.0.1:{number} \(.*\): start one with "
        r"`dask scheduler .*\n",
        told,
    ), told


def test_without_dask_it_is_told_what_to_install(nothing_flies, monkeypatch, capsys):
    monkeypatch.delitem(sys.modules, campaign_cluster.__name__)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert run(monkeypatch, "--scheduler", "tcp://127.0.0.1:1") == 2
    assert capsys.readouterr().err == (
        "campaign: --scheduler needs distributed, which this Python cannot import: "
        "`python3 -m pip install -r requirements/extra.in` brings it\n"
    )


def test_what_was_flown_until_ctrl_c_is_written(cluster, tmp_path):
    page = tmp_path / "page.md"
    command = [
        *(sys.executable, "-m", "chute_ros.tools.campaign", "--flights", "100000"),
        *("--scheduler", cluster.address, "--page", str(page), "--failures", str(tmp_path)),
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        first = process.stderr.readline()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60.0)
    assert process.returncode == 130, err
    assert err.splitlines()[-1] == "campaign: interrupted"
    assert "Traceback" not in err
    flown = int(re.search(r"^(\d+) of 100000 flights in ", out, re.M)[1])
    assert flown >= int(first.split()[0]) > 0
    assert f"FLIGHTS={flown} SEED=0`" in page.read_text()
    assert "2 workers of a Dask cluster: 2 on " in page.read_text()
