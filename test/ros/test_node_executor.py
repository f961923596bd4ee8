"""The executor of our nodes: who is served, when, and what happens to those that wait."""

import threading
import time
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from chute_ros.ros import node_executor
from chute_ros.ros.node_executor import NodeExecutor, missing, new_executor

PATIENCE = 20.0


class Spun:
    """An executor with one node, spun from here."""

    def __init__(self, namespace: str) -> None:
        self.executor = NodeExecutor()
        self.node = Node("spun", namespace=namespace)
        self.executor.add_node(self.node)

    def until(self, holds) -> None:
        end = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < end
            self.executor.spin_once(timeout_sec=0.05)

    def publisher(self, topic: str, profile=10):
        """One that somebody hears."""
        publisher = self.node.create_publisher(String, topic, profile)
        self.until(publisher.get_subscription_count)
        return publisher

    def call(self, name: str) -> Future:
        client = self.node.create_client(Trigger, name)
        self.until(client.service_is_ready)
        return client.call_async(Trigger.Request())

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def spun(namespace: str) -> Iterator[Spun]:
    one = Spun(namespace)
    yield one
    one.close()


def test_each_message_is_heard_once_and_in_order(spun):
    heard = []
    spun.node.create_subscription(String, "word", lambda m: heard.append(m.data), 100)
    publisher = spun.publisher("word", 100)
    for number in range(50):
        publisher.publish(String(data=str(number)))
    spun.until(lambda: len(heard) == 50)
    assert heard == [str(number) for number in range(50)]


def test_a_flood_on_one_topic_starves_nobody(spun):
    heard, ticks, answers = [], [], []
    flood = spun.node.create_publisher(String, "flood", 10)
    spun.node.create_subscription(String, "flood", flood.publish, 10)
    spun.node.create_subscription(String, "word", heard.append, 10)
    spun.node.create_timer(0.01, lambda: ticks.append(1))
    spun.node.create_service(Trigger, "answer", lambda _, response: response)
    word = spun.publisher("word")
    flood.publish(String())
    word.publish(String(data="x"))
    spun.call("answer").add_done_callback(answers.append)
    spun.until(lambda: heard and len(ticks) > 10 and answers)


def test_what_awaits_lets_the_others_go_on(spun):
    """A service waits for what a topic brings; another call is answered meanwhile."""
    told = Future()
    group = ReentrantCallbackGroup()

    async def slow(_, response):
        response.message = await told
        return response

    spun.node.create_service(Trigger, "slow", slow, callback_group=group)
    spun.node.create_service(Trigger, "quick", lambda _, response: response)
    spun.node.create_subscription(String, "word", lambda m: told.set_result(m.data), 10)
    word = spun.publisher("word")
    first, second = spun.call("slow"), spun.call("slow")
    quick = spun.call("quick")
    spun.until(quick.done)
    assert not first.done()
    assert not second.done()
    word.publish(String(data="now"))
    spun.until(lambda: first.done() and second.done())
    assert (first.result().message, second.result().message) == ("now", "now")


def test_a_group_that_lets_in_one_at_a_time_does_so_while_that_one_waits(spun):
    told, ticks = Future(), []

    async def slow(_, response):
        await told
        return response

    spun.node.create_service(Trigger, "slow", slow)  # in the node's own group, as this one:
    spun.node.create_service(Trigger, "other", lambda _, response: response)
    other_group = ReentrantCallbackGroup()
    spun.node.create_timer(0.01, lambda: ticks.append(1), callback_group=other_group)
    slow_client = spun.node.create_client(Trigger, "slow", callback_group=other_group)
    other_client = spun.node.create_client(Trigger, "other", callback_group=other_group)
    spun.until(lambda: slow_client.service_is_ready() and other_client.service_is_ready())
    slow_answer = slow_client.call_async(Trigger.Request())
    spun.until(lambda: spun.executor._suspended)
    other_answer = other_client.call_async(Trigger.Request())
    ticks.clear()
    spun.until(lambda: len(ticks) > 10)
    assert not other_answer.done()
    told.set_result(None)
    spun.until(lambda: slow_answer.done() and other_answer.done())


def test_a_callback_may_call_another_node_and_wait_for_it(spun, namespace):
    spun.node.create_service(
        Trigger, "answer", lambda _, response: Trigger.Response(message="yes")
    )
    group = ReentrantCallbackGroup()
    client = spun.node.create_client(Trigger, "answer", callback_group=group)
    heard = []

    async def asks(_: String) -> None:
        heard.append((await client.call_async(Trigger.Request())).message)

    spun.node.create_subscription(String, "word", asks, 10, callback_group=group)
    spun.until(client.service_is_ready)
    spun.publisher("word").publish(String())
    spun.until(lambda: heard == ["yes"])


def test_another_thread_wakes_it_at_once(spun):
    taken = threading.Event()
    guard = spun.node.create_guard_condition(taken.set)
    spun.executor.spin_once(timeout_sec=0.0)
    threading.Thread(target=guard.trigger).start()
    spun.executor.spin_once(timeout_sec=PATIENCE)
    spun.until(taken.is_set)


def test_what_is_made_while_it_spins_is_served(spun):
    heard = []

    def make() -> None:
        timer.cancel()
        spun.node.create_subscription(String, "word", heard.append, 10)

    timer = spun.node.create_timer(0.01, make)
    word = spun.publisher("word")
    word.publish(String())
    spun.until(lambda: heard)


def test_what_was_destroyed_is_not_served_and_leaves_the_graph(spun):
    heard = []
    subscription = spun.node.create_subscription(String, "word", heard.append, 10)
    word = spun.publisher("word")
    word.publish(String())
    spun.until(lambda: heard)
    spun.node.destroy_subscription(subscription)
    word.publish(String())
    spun.until(lambda: not word.get_subscription_count())
    assert len(heard) == 1


def test_a_cancelled_timer_rests_and_one_that_is_reset_goes_on(spun):
    ticks, others = [], []
    timer = spun.node.create_timer(0.01, lambda: ticks.append(1))
    spun.node.create_timer(0.01, lambda: others.append(1))
    spun.until(lambda: ticks)
    timer.cancel()
    before = len(ticks)
    others.clear()
    spun.until(lambda: len(others) > 5)
    assert len(ticks) == before
    timer.reset()
    spun.until(lambda: len(ticks) > before)


@pytest.mark.parametrize("coroutine", [False, True])
def test_a_callback_that_raises_is_heard_of_and_spoils_nothing(spun, coroutine):
    heard = []

    def bad(message: String) -> None:
        heard.append(message.data)
        if message.data == "bad":
            raise ValueError(message.data)

    async def bad_coroutine(message: String) -> None:
        bad(message)

    spun.node.create_subscription(String, "word", bad_coroutine if coroutine else bad, 10)
    word = spun.publisher("word")
    word.publish(String(data="bad"))
    with pytest.raises(ValueError, match="bad"):
        spun.until(lambda: False)
    word.publish(String(data="good"))
    spun.until(lambda: heard == ["bad", "good"])


def test_a_quality_of_service_that_does_not_match_is_told_under_a_flood_too(spun):
    events = []
    flood = spun.node.create_publisher(String, "flood", 10)
    spun.node.create_subscription(String, "flood", flood.publish, 10)
    spun.until(flood.get_subscription_count)
    flood.publish(String())
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    watch = SubscriptionEventCallbacks(incompatible_qos=events.append)
    spun.node.create_subscription(String, "word", print, latched, event_callbacks=watch)
    spun.node.create_publisher(String, "word", 10)
    spun.until(lambda: events)


def test_a_task_is_carried_out_and_what_it_raises_is_heard_of(spun):
    told = Future()

    async def wait() -> str:
        return str(await told)

    task = spun.executor.create_task(wait)
    spun.executor.spin_once(timeout_sec=0.01)
    assert not task.done()
    spun.executor.create_task(told.set_result, "x")
    spun.until(task.done)
    assert task.result() == "x"

    def bad() -> None:
        raise ValueError("bad")

    spun.executor.create_task(bad)
    with pytest.raises(ValueError, match="bad"):
        spun.until(lambda: False)


def test_a_time_to_wait_is_kept(spun):
    begun = time.monotonic()
    spun.executor.spin_once(timeout_sec=0.0)
    rclpy.spin_until_future_complete(spun.node, Future(), spun.executor, timeout_sec=0.2)
    assert 0.2 <= time.monotonic() - begun < PATIENCE


def test_this_distribution_has_every_private_member_that_is_used(spun):
    assert missing(spun.executor) == []
    assert type(new_executor()) is NodeExecutor


@pytest.mark.parametrize(
    ("owner", "gone"),
    [(SingleThreadedExecutor, "_take_timer"), (node_executor._rclpy, "InvalidHandle")],
)
def test_where_one_is_gone_a_node_runs_on_rclpy_s_own_and_says_so(
    namespace, monkeypatch, capfd, owner, gone
):
    holder = next(one for one in getattr(owner, "__mro__", (owner,)) if gone in vars(one))
    with monkeypatch.context() as change:
        change.delattr(holder, gone)
        executor = new_executor()
    assert type(executor) is SingleThreadedExecutor
    node, heard = Node("spun", namespace=namespace), []
    node.create_timer(0.01, lambda: heard.append(1))
    executor.add_node(node)
    while not heard:
        executor.spin_once(timeout_sec=PATIENCE)
    executor.shutdown()
    node.destroy_node()
    assert f"rclpy no longer has {gone}: its own executor is used" in capfd.readouterr().err


def test_a_shutdown_ends_it(namespace):
    context = Context()
    rclpy.init(args=[], context=context)
    executor = NodeExecutor(context=context)
    node = Node("spun", namespace=namespace, context=context)
    executor.add_node(node)
    spins, ended = threading.Event(), threading.Event()

    def spin() -> None:
        with pytest.raises(ExternalShutdownException):
            executor.spin()
        ended.set()

    thread = threading.Thread(target=spin)
    thread.start()
    node.create_timer(0.01, spins.set)
    assert spins.wait(PATIENCE)
    context.shutdown()
    assert ended.wait(PATIENCE)
    thread.join()
    executor.shutdown()
    node.destroy_node()
