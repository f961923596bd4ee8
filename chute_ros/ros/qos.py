"""The quality of service of the contract: reliable everywhere, latched where said."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def reliable(depth: int) -> QoSProfile:
    """RELIABLE, VOLATILE, this depth."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


STATUS = reliable(10)
#: Volatile: a restarted node must never act on an old decision.
DECISION = reliable(50)


def _latched(depth: int) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


LATCHED = _latched(1)
#: Kills and deploys for whoever comes late; no node acts on them.
HISTORY = _latched(20)


def newest(profile: QoSProfile) -> QoSProfile:
    """How our nodes listen to what is said again soon anyway: pictures, heartbeats, decisions that
    nobody has reported on. A reliable subscription holds everything back that follows a lost
    message until that one was sent again, and it is too old by then."""
    return QoSProfile(
        depth=profile.depth,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )
