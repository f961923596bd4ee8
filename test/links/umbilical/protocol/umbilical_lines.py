"""Lines of the flight computer: some typed by hand, and others made for any layout."""

import struct
from decimal import Decimal
from pathlib import Path

from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.layouts import Record
from chute_ros.links.umbilical.protocol.stream import DumpBytes

FOLDER = Path(__file__).parents[4] / "msg_defs" / "telem"

STATE = "telem57_airbrake_state"
DEPLOYMENT = "telem57_airbrake_deployment"
COUNTS = {"telem50": 50, "telem52": 52, "telem54": 54, STATE: 57, DEPLOYMENT: 57}

#: Umbilical Reference, section 3: type and name of fields 1 to 57.
REFERENCE = """
u32 flight_mode, f32 pressure, f32 temp, f32 altitude, f32 latitude, f32 longitude,
u32 num_satellites, f32 timestamp,
f32 mag_x, f32 mag_y, f32 mag_z, f32 accel_x, f32 accel_y, f32 accel_z,
f32 gyro_x, f32 gyro_y, f32 gyro_z, f32 pt3, f32 pt4, f32 rtd,
bool01 sv_open, bool01 mav_open, u8 ssa_drogue_deployed, u8 ssa_main_deployed,
u8 cmd_n1, u8 cmd_n2, u8 cmd_n3, u8 cmd_n4, u8 cmd_a1, u8 cmd_a2, u8 cmd_a3,
u8 airbrake_state, f32 predicted_apogee, u32 h_acc, u32 v_acc,
f64 vel_n, f64 vel_e, f64 vel_d, f64 g_speed, u32 s_acc, u32 head_acc, u8 fix_type, i32 head_mot,
f32 blims_motor_position, i8 blims_phase_id, f32 blims_pid_p, f32 blims_pid_i, f32 blims_bearing,
i8 blims_loiter_step, f32 blims_heading_des, f32 blims_heading_error, f32 blims_error_integral,
f32 blims_dist_to_target_m, f32 blims_target_lat, f32 blims_target_lon,
f32 blims_wind_from_deg, u32 ms_since_boot_cfc
"""
REFERENCE_FIELDS = [tuple(reversed(one.split())) for one in REFERENCE.split(",")]

#: On the pad: Standby, and what a person would expect there.
PAD = (
    b"$TELEM,1,101325.5,21.25,12.5,42.441914,-76.4878,11,43200.25,-12.5,30,48.75,0.1,-0.2,9.80665,"
    b"0.5,-0.25,0.125,512,1023.5,-1,0,0,0,0,0,0,0,0,0,0,0,0,12.75,1500,2500,0.01,-0.02,0.03,"
    b"0.022360679774997897,120,500000,3,-17950000,0.5,-1,0.25,0.125,270.5,-3,90,-1.5,0.0625,"
    b"1250.5,42.4419,-76.4879,225,123456\n"
)
PAD_VALUES = dict(
    zip(
        (name for name, _ in REFERENCE_FIELDS),
        (
            *(1, 101325.5, 21.25, 12.5, 42.441914, -76.4878, 11, 43200.25, -12.5, 30.0, 48.75),
            *(0.1, -0.2, 9.80665, 0.5, -0.25, 0.125, 512.0, 1023.5, -1.0, 0, 0, 0, 0),
            *(0, 0, 0, 0, 0, 0, 0, 0, 12.75, 1500, 2500, 0.01, -0.02, 0.03),
            *(0.022360679774997897, 120, 500000, 3, -17950000, 0.5, -1, 0.25, 0.125, 270.5, -3),
            *(90.0, -1.5, 0.0625, 1250.5, 42.4419, -76.4879, 225.0, 123456),
        ),
        strict=True,
    )
)


_ORDINARY = {
    "bool01": "0",
    "u8": "1",
    "u32": "7",
    "i8": "-3",
    "i32": "-40000",
    "f32": "12.5",
    "f64": "-0.25",
}
_ORDINARY_FIELDS = {"airbrake_deployment": "0.5", "airbrake_state": "2"}


#: All that are shipped, the reference's first.
LAYOUTS = load_layouts(str(FOLDER), "test")
BY_NAME = {layout.name: layout for layout in LAYOUTS}
LAYOUT = BY_NAME[STATE]


def body(layout=LAYOUT, **texts):
    """What stands behind "$TELEM,"; texts: fields that differ from the ordinary ones."""
    strange = set(texts) - set(layout.index)
    assert not strange, f"{layout.name} has no {strange}"
    ordinary = {one.name: _ORDINARY[one.kind.name] for one in layout.fields}
    ordinary.update({k: v for k, v in _ORDINARY_FIELDS.items() if k in ordinary})
    return ",".join({**ordinary, **texts}.values())


def line(layout=LAYOUT, **texts):
    """A whole line as it comes."""
    return f"$TELEM,{body(layout, **texts)}\n".encode()


def record(at, **texts):
    """A record of the reference's layout, received at this time."""
    values = LAYOUT.decode(body(**texts))
    assert isinstance(values, tuple), values
    return Record(LAYOUT, values, at)


def as_rust_prints(value, kind):
    """Shortest text that reads back as the same f32 or f64, without an exponent; or a whole one.

    kind: the name of the type.
    """
    if kind not in ("f32", "f64"):
        return str(value)
    if value != value:
        return "NaN"
    if value in (float("inf"), float("-inf")):
        return str(value)
    code = "f" if kind == "f32" else "d"
    packed = struct.pack(code, value)
    for digits in range(1, 18):
        text = f"{value:.{digits}g}"
        try:
            if struct.pack(code, float(text)) == packed:
                break
        except OverflowError:
            continue  # rounded up to more than an f32 holds
    plain = f"{Decimal(text):f}"
    return plain.rstrip("0").rstrip(".") if "." in plain else plain


def as_f32(value):
    """The 32-bit float next to a value."""
    return struct.unpack("f", struct.pack("f", value))[0]


#: What the dumps of flash begin and end with.
BEGIN_CSV, END_CSV = b"--- BEGIN FLASH CSV DUMP ---\n", b"--- END FLASH CSV DUMP ---\n"
BEGIN, END = b"--- BEGIN FLASH BINARY DUMP ---\n", b"--- END FLASH BINARY DUMP ---\n"


def joined(items):
    """What a stream gave, neighbouring bytes of a dump as one."""
    found = []
    for item in items:
        if found and isinstance(item, DumpBytes) and isinstance(found[-1], DumpBytes):
            found[-1] = DumpBytes(found[-1].data + item.data)
        else:
            found.append(item)
    return found
