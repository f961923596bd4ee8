"""The campaign on a Dask cluster of real processes: the same flights whatever becomes of them."""

import contextlib
import os
import re
import shutil
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from command_bench import flying, interrupted
from dask_bench import dask_bench
from flight_bench import run as run_main

import chute_ros
from chute_ros.campaign import campaign as flights
from chute_ros.campaign.checkpoint import text_of
from chute_ros.errors import CampaignError
from chute_ros.ros.config_folder import config_folder
from chute_ros.tools import campaign_cluster, campaign_command

#: Of short flights.
SEEDS, BUNDLE = range(117, 125), 2
PACKAGE = Path(chute_ros.__file__).parent
run = partial(run_main, campaign_command.main)
# The cluster and the flights of one process are for all.
pytestmark = pytest.mark.xdist_group("campaign_cluster")


@pytest.fixture(scope="module")
def shared():
    """The clusters of this module, each until its scheduler has died."""
    with contextlib.ExitStack() as stack:
        yield _Shared(stack)


class _Shared:
    def __init__(self, stack):
        self._stack, self._bench = stack, None

    def bench(self):
        if self._bench is None or self._bench.scheduler.poll() is not None:
            self._stack.close()
            self._bench = self._stack.enter_context(dask_bench())
        return self._bench


@pytest.fixture
def cluster(shared):
    """Two workers, and a scheduler, whatever an earlier test did to them."""
    bench = shared.bench()
    bench.has_workers(2)
    return bench


@pytest.fixture(autouse=True)
def small_bundles(monkeypatch):
    """Many, of a few flights."""
    monkeypatch.setattr(campaign_cluster, "_BUNDLE", BUNDLE)


@pytest.fixture
def nothing_flies(monkeypatch):
    """What flies now raises."""
    monkeypatch.setattr(flights, "run", None)


#: The flights of one process, as text.
_BY_ONE = f"""
from functools import partial
from chute_ros.campaign import campaign as flights
from chute_ros.campaign.checkpoint import text_of
from chute_ros.campaign.pool import flown_here
from chute_ros.campaign.shipped import Shipped
from chute_ros.ros.config_folder import config_folder

profiles = config_folder() / "profiles"
flown = flown_here(partial(flights.fly_bundle, profiles), Shipped(profiles), {SEEDS!r}, 1)
tally = flights.run(flown, lambda _: None, flights.Tally())
tally.took = 0.0
print(text_of(tally, {SEEDS[0]}, ""), end="")
"""


@pytest.fixture(scope="module")
def by_one_process():
    """In a Python of its own, which finds the links that the workers find."""
    return subprocess.run(
        [sys.executable, "-c", _BY_ONE], stdout=subprocess.PIPE, text=True, check=True
    ).stdout


def kept(tally):
    """All that is counted and measured, to the last digit, but the time that it took."""
    tally.took = 0.0
    return text_of(tally, SEEDS[0], "")


def transitions(flown):
    """(key, state before, state after) of the scheduler's tasks, those of earlier tests too."""
    return flown._client.run_on_scheduler(
        lambda dask_scheduler: [one[:3] for one in dask_scheduler.transition_log]
    )


def test_a_worker_that_dies_costs_its_bundle_again_and_nothing_else(cluster, by_one_process):
    flown = campaign_cluster.Cluster(cluster.address)
    with contextlib.closing(flown):
        assert flown.workers == 2
        earlier = {key for key, *_ in transitions(flown)}
        died = []

        def look(tally):
            if tally.flights == BUNDLE:
                flies = flown._client.processing()
                address = max(flies, key=lambda one: len(flies[one]))
                assert flies[address], "it flies"
                cluster.workers[address].kill()
                died.append(address)
                cluster.start_worker()

        tally = flights.run(flown.flown(SEEDS), look, flights.Tally())
        steps = [(was, now) for key, was, now in transitions(flown) if key not in earlier]
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
    look = campaign_command._CampaignProgress.look

    def killing(progress, tally):
        look(progress, tally)
        if tally.flights == BUNDLE:
            cluster.scheduler.kill()

    monkeypatch.setattr(campaign_command._CampaignProgress, "look", killing)
    told = run(monkeypatch, *options, cluster.address)
    assert told == (
        f"campaign: the scheduler at {cluster.address} is gone; the flights until then are "
        "reported, and --resume FILE continues from them"
    )
    first = re.search(rf"^(\d+) of {len(SEEDS)} flights in", capsys.readouterr().out, re.M)
    assert BUNDLE <= int(first[1]) < len(SEEDS)
    monkeypatch.setattr(campaign_command._CampaignProgress, "look", look)
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
    shutil.copytree(PACKAGE, folder / "chute_ros")
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
    change, words, cluster, nothing_flies, monkeypatch, tmp_path, capsys
):
    other = cluster.start_worker(**copied(tmp_path, change))
    assert run(monkeypatch, "--scheduler", cluster.address) == 2
    out, err = capsys.readouterr()
    assert not out
    assert re.fullmatch(rf"campaign: worker {other}: {words}.*\n", err), err
    assert "install the same on both (docs/guide/cluster.md)" in err


def test_a_worker_of_two_threads_is_refused(cluster, nothing_flies, monkeypatch, capsys):
    other = cluster.start_worker("--nthreads", "2")
    assert run(monkeypatch, "--scheduler", cluster.address) == 2
    told = f"worker {other}: it runs 2 threads: start it with --nthreads 1 --nworkers N"
    assert capsys.readouterr().err == f"campaign: {told}\n"


@pytest.fixture
def without(tmp_path):
    """An environment without the code."""
    (tmp_path / "chute_ros").mkdir()
    (tmp_path / "chute_ros" / "__init__.py").write_text("")
    return {"PYTHONPATH": f"{tmp_path}{os.pathsep}{os.environ['PYTHONPATH']}"}


def assert_told_what_lacks_the_code(named, told):
    assert told.startswith(f"campaign: {named}: ModuleNotFoundError")
    assert "No module named 'chute_ros." in told
    assert told.endswith("install the same on both (docs/guide/cluster.md)\n")


def test_a_worker_without_the_code_is_named(without, cluster, nothing_flies, monkeypatch, capsys):
    worker = cluster.start_worker(**without)
    assert run(monkeypatch, "--scheduler", cluster.address) == 2
    assert_told_what_lacks_the_code(f"worker {worker}", capsys.readouterr().err)


def test_a_scheduler_without_workers_is_told_with_the_remedy_and_then_that_it_lacks_the_code(
    without, nothing_flies, monkeypatch, capsys
):
    with dask_bench(**without) as bench:
        with monkeypatch.context() as impatient:
            impatient.setattr(campaign_cluster, "_PATIENCE", 5.0)
            assert run(monkeypatch, "--scheduler", bench.address) == 2
        told = capsys.readouterr().err
        assert told == (
            f"campaign: the scheduler at {bench.address} has no workers after 5 s: start some "
            f"with `dask worker {bench.address} --nthreads 1 --nworkers N` "
            "(docs/guide/cluster.md)\n"
        )
        bench.start_worker()
        assert run(monkeypatch, "--scheduler", bench.address) == 2
    assert_told_what_lacks_the_code(f"scheduler {bench.address}", capsys.readouterr().err)


def test_a_worker_that_comes_later_and_differs_ends_it(cluster, tmp_path):
    changed, other = copied(tmp_path, "chute_ros/supervisor/core.py"), []

    def look(tally):
        if tally.flights == 1:
            for process in cluster.workers.values():
                process.kill()
            other.append(cluster.start_worker(**changed))

    tally = flights.Tally()
    flown = campaign_cluster.Cluster(cluster.address)
    with contextlib.closing(flown), pytest.raises(CampaignError) as ended:
        flights.run(flown.flown(SEEDS), look, tally)
    assert str(ended.value).startswith(f"worker {other[0]}: its code is ")
    assert 1 <= tally.flights < len(SEEDS)


@contextlib.contextmanager
def nobody(_):
    """A port at which nobody listens; held, so that no other test's server comes to it."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        yield held.getsockname()[1]


@contextlib.contextmanager
def silent(_):
    """A port at which something listens that never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@contextlib.contextmanager
def worker(cluster):
    """The port of a worker, which answers as well."""
    yield next(iter(cluster.workers)).rpartition(":")[2]


@pytest.mark.parametrize("port", [nobody, silent, worker])
def test_where_no_scheduler_is_it_is_told_with_the_remedy(
    port, cluster, nothing_flies, monkeypatch, capsys
):
    monkeypatch.setattr(campaign_cluster, "_PATIENCE", 1.0)
    with port(cluster) as number:
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
    options = ("--scheduler", cluster.address, "--page", str(page), "--failures", str(tmp_path))
    small = f"from chute_ros.tools import campaign_cluster as c; c._BUNDLE = {BUNDLE}"
    with flying("campaign", *options, changed=small) as process:
        first, out, err = interrupted(process)
    assert err.splitlines()[-1] == "campaign: interrupted"
    flown = int(re.search(r"^(\d+) of 100000 flights in ", out, re.M)[1])
    assert flown >= int(first.split()[0]) > 0
    assert f"FLIGHTS={flown} SEED=0`" in page.read_text()
    assert "2 workers of a Dask cluster: 2 on " in page.read_text()
