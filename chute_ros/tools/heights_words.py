"""What the page of needed heights says besides its numbers."""

from __future__ import annotations

from chute_ros.campaign.cases import FLOWN_BEFORE
from chute_ros.campaign.confidence import CONFIDENCE
from chute_ros.campaign.needed_height import CEILING, GRAIN
from chute_ros.sim.autopilot_device import GUSTS_OF_WIND

INTRODUCTION = """\
How low may a failure happen, so that the vehicle still lands softly under its canopy? And how
long does it take from the failure to the release, and to the canopy that carries? Each number
below is of a described vehicle in a simulated world.

**The numbers prove nothing about a real vehicle, and this page is no certificate.** They show
what this product's part of the time and of the height is, and they fit your vehicle as well as
its description and the assumptions below do. `docs/guide/minimum_height.md` says how to describe
your own."""

HOW = f"""\
- Each flight is a flight of the fault campaign (`docs/evidence/campaign.md`): the real core,
  protocols and runtime, with simulated devices in virtual time. Mass, drag, canopy, heights, wind,
  link, autopilot and profile are those of the description. Nothing fails besides the failure
  itself.
- Each seed is flown from a height that the vehicle is flown at, and then from lower heights with
  the same gusts and messages, down to the least height (to {GRAIN:g} m) from which it is saved.
  Saved: the parachute is out, and the vehicle no faster than `soft_landing` when the canopy is
  open or when it touches down. If it is not saved from the usual height, it is tried from
  {CEILING:g} m.
- The heights are above the ground, at the moment of the failure. Each height was flown, so the
  rules' own heights are in it: `minimum_height`, and `low_height` with its shorter wait for the
  kill.
- **Bound**: a distribution-free tolerance bound (Wilks). With {100.0 * CONFIDENCE:g} % confidence
  at least the share in the column needs no more height, if failures are drawn as described. Too
  few flights bound a smaller share only, and the page says so.
- A vehicle that falls from less than about 2 m touches down softly by itself. Between that and
  the needed height it hits the ground faster than `soft_landing`."""

ASSUMPTIONS = f"""\
- **Body**: a point mass that moves up and down, with quadratic drag; its speed of fall follows
  from `mass` and `drag_area` in the air of the sea level. What tumbles turns with 1.6 rad/s.
  Spins, dives and partial thrust settle to a sink, a tilt and a force of their own
  (`chute_ros/sim/flight.py`).
- **Speed over ground is not modelled**, so the description has no field for it: a failure at
  cruise speed is a failure in level flight. A real canopy opens faster at speed, and may tear.
- **Canopy**: its drag grows with the square of the time since the release, and is full after
  `opening_time`, which must hold the ejection and the stretch of the lines. It always opens: no
  entanglement, no damage, no swing, no squid. Motors that still turn harm no line.
- **Wind**: gusts push up and down, with {GUSTS_OF_WIND:g} m/s^2 for each m/s of wind. No drift,
  no steady up- or downdraught, no sideways touchdown: the energies are of the vertical speed
  alone.
  A gust may carry what sinks slowly (`thrust partly lost`) for seconds: then it sinks no faster
  than softly, is noticed late, and needs more height.
- **Failure**: sudden and complete, in steady flight for {FLOWN_BEFORE:g} s and more. Each number
  that has a range is drawn from it, each as likely; sinks that the description leaves out are
  drawn like the campaign's. An autopilot that restarts reports again at once, and rightly: a real
  one needs a second and more, and its estimate longer, in which nothing is seen.
- **Ground**: level with the take-off. Over higher ground the height above it counts; the rules'
  `minimum_height` is above the take-off.
- **Chain**: one supervisor with its parameters as delivered, one computer that is never late, no
  message lost, sensors without errors. The simulated autopilots stop the motors and confirm it
  within 0.05 s; a `px4` orders the release itself as it terminates the flight. The simulated
  MAVLink parachute refuses below 8 m.
- **Left out**, as they need no parachute: an aeroplane without its motor that glides, an
  autopilot that hangs while the vehicle flies on."""

WITH_FAULTS = """\
The same failures, each with one of the campaign's faults or more, up to {}, within 2 s of it:
messages lost, late or damaged, processes and devices that stop, clocks that are set, sensors that
are wrong. A flight that was released before its failure is left out of the count."""
