"""Arm and disarm at nearly one time: the newer order has the last word."""


class Slow:
    """The devices take what the link sends so much later, s."""

    def __init__(self, story, delay):
        self._story = story
        self._delay = delay
        self._take = story.devices.receive
        self._held: list[tuple[float, bytes]] = []
        story.devices.receive = lambda data, now: self._held.append((story.t + delay, data))

    def after(self, seconds):
        story, end = self._story, self._story.t + seconds
        while story.t < end - 1e-9:
            story.t = round(story.t + 0.001, 6)
            while self._held and self._held[0][0] <= story.t:
                self._take(self._held.pop(0)[1], story.now)
            story.step()
        return story


def test_a_disarm_that_follows_an_arm_at_once_leaves_it_disarmed(bench):
    story = bench().ready()
    slow = Slow(story, 0.02)
    story.call("arm", 1, True, 0)
    slow.after(0.005)
    story.call("arm", 2, False, 0)
    slow.after(3.0)
    assert story.controller.state.name in ("READY", "TAKEOFF")
    assert "given up: TYPE_DISARM was ordered" in story.end(1).message
    assert story.end(2).success
    assert story.controller.requests_heard[-1] == "TYPE_DISARM"


def test_a_disarm_that_was_lost_is_not_sent_again_after_an_arm(bench):
    story = bench().in_flight()
    lost_until = story.t + 0.3
    story.loses = lambda from_link, data: from_link and story.t < lost_until
    story.call("arm", 1, False, 0).after(0.1).call("arm", 2, True, 0).after(5.0)
    assert story.controller.state.name == "ARMED"
    assert "given up: TYPE_ARM was ordered" in story.end(1).message
    assert story.end(2).success
    assert "TYPE_DISARM" not in story.controller.requests_heard


def test_another_controllers_request_goes_on(bench):
    story = bench("").status("READY", 33).status("ARMED", 125).clear()
    story.call("service", 1, "TYPE_TAKEOFF", 33).call("service", 2, "TYPE_DISARM", 125)
    assert not story.ends(1)
