"""The quality of service of the contract: reliable everywhere, latched where said."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def reliable(depth: int, durability: DurabilityPolicy = DurabilityPolicy.VOLATILE) -> QoSProfile:
    """RELIABLE, this depth."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


STATUS = reliable(10)
#: Volatile: a restarted node must never act on an old decision.
DECISION = reliable(50)

LATCHED = reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)
#: Kills and deploys for whoever comes late; no node acts on them.
HISTORY = reliable(20, DurabilityPolicy.TRANSIENT_LOCAL)


def newest(profile: QoSProfile) -> QoSProfile:
    """How our nodes listen to what is said again soon anyway: pictures, heartbeats, decisions that
    nobody has reported on. A reliable subscription holds everything back that follows a lost
    message until that one was sent again, and it is too old by then."""
    return QoSProfile(
        depth=profile.depth,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )
