"""What the page of the comparison says besides its numbers."""

from __future__ import annotations

from chute_ros.campaign.comparison import CURVE_OF, FACTORS

INTRODUCTION = """\
The flights of the [fault campaign](campaign.md), flown again for each guard in one run and counted
by the same judge from the same truth. A guard is who decides about motors and parachute: this
product, or one of its peers. A peer runs in the autopilot itself, 50 times a second (the step of
the flight model), on what that autopilot's own sensors and estimator say, with the scenario's
faults of both. The peer is dead or hung while the autopilot is, and begins again when it restarts.
It stops the motors and releases the parachute on its own output. Each peer is written in our own
words from its documentation and source (`chute_ros/campaign/peers/`, each number with its source);
it is not the peer's code."""

SHORT = """\
In short, without any excuse (below): how many were saved of the flights that only a parachute
could save, and how many of all were ended although they went well."""

RULES = """\
What makes this fair, or not:

- Rockets are left out: no peer flies them. Nobody orders anything: no arming, kill or deploy by a
  person. No parachute releases itself, and every canopy carries and opens in 1.2 s: these are
  features of parachutes, not of guards. Two parachutes on two links are flown by this product
  alone; a peer has one.
- Faults on networks, buses, cables, nodes and the supervisor's process exist for this product
  only. They are harmless to a peer in the autopilot, but the judge excuses everybody for them.
  Vehicles with an IMU or odometry besides the autopilot have it for this product only; a peer does
  not read it.
- A wrong `disarmed` in a heartbeat is a fault of the telemetry, and harmless to a peer. A wrong
  `landed` is the land detector's, and reaches a peer as well.
- Flips and dives of 45 degrees and more are flown in ArduCopter's FLIP or ACRO mode and PX4's Acro
  mode, where their attitude checks are off; after a failure they are on at once. The threshold
  does not know the mode.
- Banks of more than 45 degrees are flown in flips and dives alone. An aeroplane that banks so in
  turns would make a bare limit of the tilt false; here it costs PX4 nothing.
- PX4 only disarms within 4 s of its arming (COM_LKDOWN_TKO, COM_SPOOLUP_TIME). The climb, which
  the campaign shortens, counts as if flown at 6 m/s. PX4's source does not ask the land detector
  before a termination. Disarming after a landing (COM_DISARM_LAND), which a wrong `landed` would
  cause in the air, is not modelled.
- A vehicle takes off when this product's supervisor, or at once when the peer, lets it. Gusts and
  the noise of sensors are of the same strength, but not the same sample by sample.
- The judge's excuses are the campaign's, for every guard: too little time (2 s and more), sensors
  that were wrong in pairs, ways and processes that failed. The second count excuses nothing: it
  asks only whether the vehicle was saved and whether one that flew well was left alone. Flights
  that no release could save stay "no time" there."""

CLASSES = """\
In each cell: missed or late / false, without any excuse."""

BETTER = """\
Every class in which a peer has fewer missed or late or fewer false flights than this product,
without any excuse, or releases earlier: the median over the flights in which both released, of
five at least. Seeds: flights that the peer ends well and this product does not, or those in which
the peer is earliest. A guard that never acts has no false flight."""
WHY_BETTER = """\
PX4's failure detector takes a roll or pitch beyond 60 degrees for 0.3 s for a failure, by its
estimator alone. This product waits for a second origin besides the attitude: a force that is
missing, or a sink, which comes the later the flatter an aeroplane spins. So a wrong estimator ends
flights of PX4 that go well. `free fall` of an aeroplane waits 0.5 s: sticks that are reversed in a
descent, and push it over, leave it far from its target and without force for 0.3 s."""
EXCUSED = """\
Flights that the campaign counts as "no time" or "not told" for this product, and that a peer ends
well: the excuse is not one of physics."""
DELAYS = """\
Of the flights that only a parachute could save. The last two columns: medians over the flights in
which both the peer and this product released."""
_SCALES = ", ".join(f"{one:g}" for one in FACTORS)
CURVES = f"""\
One of {CURVE_OF} flights was flown again with each guard scaled by {_SCALES}: the time of every
rule (`for`) of this product and no other limit of it, the limits of a peer (the table of settings
says which). Missed or late in percent of the flights that only a parachute could save;
false in percent of all. The large dot: not scaled."""
