"""What a leading supervisor tells those that follow, so that one can go on where it stopped.

Links and measurements are not in it: each supervisor hears them itself. What is in it is what was
decided and what became of it.
"""

from __future__ import annotations

from types import MappingProxyType

from chute_ros.errors import RecordError
from chute_ros.supervisor.codec import Codec
from chute_ros.supervisor.epochs import LARGEST_EPOCH
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import Pending, State

_CODEC = Codec(State)
#: An id of chute_msgs/SafetyDecision has 64 bits; who goes on from here must have ids left.
_LARGEST_ID = 2**63


def told(state: State, now: float) -> str:
    """The state for those that follow, as JSON, with its times as ages at now (monotonic s)."""
    kept = State(
        epoch=state.epoch,
        started_at=state.started_at,
        stage=state.stage,
        stage_since=state.stage_since,
        mode=state.mode,
        next_id=state.next_id,
        rules=state.rules,
        asks=state.asks,
        block=state.block,
        kill=state.kill,
        deploys=state.deploys,
        deploy_rule=state.deploy_rule,
        deploy_reasons=state.deploy_reasons,
        deploy_ladder=state.deploy_ladder,
        deploy_due=state.deploy_due,
        flown=state.flown,
        airborne=state.airborne,
        killed_in_flight=state.killed_in_flight,
        killed_at=state.killed_at,
        killed_height=state.killed_height,
        killed_sinking=state.killed_sinking,
        killed_standing=state.killed_standing,
        landed_at=state.landed_at,
        kill_only=state.kill_only,
        home_altitude=state.home_altitude,
        ground_pressure_altitude=state.ground_pressure_altitude,
        was_high=state.was_high,
        up_for=state.up_for,
        armed_by_us=state.armed_by_us,
        airborne_since=state.airborne_since,
        down_since=state.down_since,
        rebooted=state.rebooted,
        reboots_before=state.reboots_before,
        armed_height=state.armed_height,
        took_off_height=state.took_off_height,
        newest=state.newest,
        home=state.home,
        released_before=state.released_before,
        device_blocks=state.device_blocks,
        block_refused=state.block_refused,
        alarms=state.alarms,
        alarm_at=state.alarm_at,
        canopy_fails=state.canopy_fails,
    )
    return _CODEC.to_json(_moved(kept, -now))


def followed(state: State, text: str, now: float) -> State:
    """state with what the leader told just now (monotonic s of this host). RecordError: another
    version wrote it, or none of ours did."""
    leader = _CODEC.from_json(text)
    if not isinstance(leader, State):
        raise RecordError(f"not a state: {text[:80]!r}")
    check_numbers(leader)
    return replace(
        _moved(leader, now),
        leading=False,
        updated_at=state.updated_at,
        late_count=state.late_count,
        links=state.links,
        vehicle=state.vehicle,
        vehicle_received=state.vehicle_received,
        disputed=state.disputed,
        measurements=state.measurements,
        heights=state.heights,
        pressure_heights=state.pressure_heights,
        pressure_before=state.pressure_before,
        motion=state.motion,
        denied=state.denied,
        denied_since=state.denied_since,
        commanded=state.commanded,
        unfit=state.unfit,
        fitness_since=state.fitness_since,
        still_since=state.still_since,
        at_ground_since=state.at_ground_since,
        faults_told=state.faults_told,
    )


def check_numbers(state: State) -> None:
    """RecordError for numbers under which nothing can be decided nor told."""
    pending = [one for one in (state.block, state.kill, *state.deploys) if one is not None]
    numbers = [(state.epoch, state.next_id), *(one.number for one in pending)]
    if state.newest is not None:
        numbers.append((state.newest.epoch, state.newest.id))
    for epoch, number in numbers:
        if not (1 <= epoch <= LARGEST_EPOCH and 1 <= number <= _LARGEST_ID):
            raise RecordError(f"no decision has the number {epoch}.{number}")


def _moved(state: State, by: float) -> State:
    """Every time moved by so many s."""
    return replace(
        state,
        started_at=state.started_at + by,
        stage_since=state.stage_since + by,
        asks=MappingProxyType({w: replace(a, at=a.at + by) for w, a in state.asks.items()}),
        block=state.block and _moved_pending(state.block, by),
        kill=state.kill and _moved_pending(state.kill, by),
        deploys=tuple(_moved_pending(deploy, by) for deploy in state.deploys),
        deploy_due=state.deploy_due + by,
        killed_at=state.killed_at + by,
        down_since=state.down_since + by,
        landed_at=state.landed_at + by,
        airborne_since=state.airborne_since + by,
        alarm_at=state.alarm_at + by,
    )


def _moved_pending(pending: Pending, by: float) -> Pending:
    return replace(pending, decided_at=pending.decided_at + by, sent_at=pending.sent_at + by)
