"""A $TELEM record as the message Telem: every field under one name, whatever its layout.

Source: Umbilical Reference, section 3; units as in msg_defs/msg/Telem.msg.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from chute_msgs.msg import Telem

from chute_ros import model
from chute_ros.links.umbilical.protocol.layouts import Layout, Record

#: Field of a layout -> field of Telem, where the unit is put into the name.
RENAMED = {
    "temp": "temp_degc",
    "latitude": "latitude_deg",
    "longitude": "longitude_deg",
    "mag_x": "mag_x_microtesla",
    "mag_y": "mag_y_microtesla",
    "mag_z": "mag_z_microtesla",
    "gyro_x": "gyro_x_deg_s",
    "gyro_y": "gyro_y_deg_s",
    "gyro_z": "gyro_z_deg_s",
    "pt3": "pt3_adc",
    "pt4": "pt4_adc",
    "rtd": "rtd_adc",
    "h_acc": "h_acc_mm",
    "v_acc": "v_acc_mm",
    "s_acc": "s_acc_mm_s",
    "head_acc": "head_acc_deg1e5",
    "head_mot": "head_mot_deg1e5",
    "blims_brakeline_diff": "blims_brakeline_diff_in",
    "blims_bearing": "blims_bearing_deg",
    "blims_heading_des": "blims_heading_des_deg",
    "blims_heading_error": "blims_heading_error_deg",
    "blims_dist_to_target_m": "blims_dist_to_target",
    "blims_target_lat": "blims_target_lat_deg",
    "blims_target_lon": "blims_target_lon_deg",
    "blims_upwind_lat": "blims_upwind_lat_deg",
    "blims_upwind_lon": "blims_upwind_lon_deg",
    "blims_downwind_lat": "blims_downwind_lat_deg",
    "blims_downwind_lon": "blims_downwind_lon_deg",
    "ms_since_boot_cfc": "device_uptime",
}
#: Not fields of a record.
_OWN = ("header", "layout", "sequence")
#: What a whole number reads that the record's layout lacks.
_LACKING = {"flight_mode": Telem.FLIGHT_MODE_UNKNOWN}
_LACKING |= dict.fromkeys(("blims_phase_id", "blims_loiter_step"), -32768)

#: What Telem's whole numbers hold.
_RANGES = {"uint8": (0, 2**8 - 1), "int8": (-(2**7), 2**7 - 1), "int16": (-(2**15), 2**15 - 1)}
_CONVERT: dict[str, Callable[[Any], Any]] = {
    "flight_mode": lambda value: value if 0 <= value < 2**8 else Telem.FLIGHT_MODE_UNKNOWN,
    "device_uptime": lambda value: value / 1000.0,
}


def without_place(layout: Layout) -> list[str]:
    """The fields of a layout that Telem has no field for."""
    known = Telem.get_fields_and_field_types()
    return [name for name in layout.index if RENAMED.get(name, name) not in known]


def unfit(layout: Layout) -> list[str]:
    """The fields of a layout that Telem cannot hold, in words: a number with a fraction, or NaN,
    has no place in a whole one."""
    types = Telem.get_fields_and_field_types()
    places = ((one, types.get(RENAMED.get(one.name, one.name))) for one in layout.fields)
    return [
        f"{one.name} is {one.kind.name} where umbilical/telem has {place}"
        for one, place in places
        if place in _RANGES and not one.kind.is_whole
    ]


def telem(record: Record, sequence: int, stamp: Any) -> Telem:
    """As it is published on umbilical/telem."""
    places, lacking = _places(record.layout)
    message = Telem(layout=record.layout.name, sequence=sequence)
    message.header.stamp = stamp
    for name, value in lacking:
        setattr(message, name, value)
    for name, index, convert in places:
        setattr(message, name, convert(record.values[index]))
    return message


def _into(kind: str) -> Callable[[Any], Any]:
    """A number that is too large for its place reads as the largest that has one."""
    if kind not in _RANGES:
        return float
    lowest, highest = _RANGES[kind]
    return lambda value: max(lowest, min(int(value), highest))


@cache
def _places(
    layout: Layout,
) -> tuple[list[tuple[str, int, Callable[[Any], Any]]], list[tuple[str, Any]]]:
    """(name, place in the record, conversion) of each field; (name, value) of those lacking."""
    types = Telem.get_fields_and_field_types()
    places = []
    for field, index in layout.index.items():
        name = RENAMED.get(field, field)
        if name in types:
            places.append((name, index, _CONVERT.get(name) or _into(types[name])))
    present = {name for name, _, _ in places}
    lacking = [
        (name, model.NAN if kind == "double" else _LACKING.get(name, -1))
        for name, kind in types.items()
        if name not in present and name not in _OWN
    ]
    return places, lacking
