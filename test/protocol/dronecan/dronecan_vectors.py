"""Transfers with the bytes that the dronecan library makes of them (test_dronecan_golden.py asks).

Floats are such as a float16 holds exactly.
"""

from chute_ros.protocol.dronecan.can_frame import CanFrame
from chute_ros.protocol.dronecan.transfer import Transfer, TransferKind

#: Of the anonymous messages.
DISCRIMINATOR = 0x1234


class Vector:
    """One transfer: what it says, its payload and its frames as identifier#data.

    what: "story: type", a service's with its mode. where: source, destination, transfer id,
    priority. frames: identifier#data, and the data of each further one.
    """

    def __init__(self, what, where, frames, values):
        self.story, _, kind = what.partition(": ")
        self.name, _, mode = kind.partition(" ")
        self.mode = mode or None
        self.source, self.destination, self.transfer_id, self.priority = where
        identifier, _, data = frames.partition("#")
        self.frames = tuple(f"{identifier}#{one}" for one in data.split())
        # The last byte of each frame is its tail; of several, the first begins with a CRC.
        whole = "".join(one[:-2] for one in data.split())
        self.payload = whole[4:] if len(self.frames) > 1 else whole
        self.values = values

    @property
    def can_frames(self):
        pairs = [one.split("#") for one in self.frames]
        return [CanFrame(int(number, 16), bytes.fromhex(data)) for number, data in pairs]

    def transfer(self, type_id):
        payload = bytes.fromhex(self.payload)
        where = (self.source, self.destination, self.transfer_id)
        return Transfer(TransferKind(self.mode), type_id, *where, payload, self.priority)


UNIT = bytes(range(16))
VECTORS = [
    Vector(
        "parachute_status: flyfire.ParachuteStatus",
        (1, 0, 0, 16),
        "10067f01#1bbb9809404a8080 c2004860",
        {
            "state": 4,
            "is_vehicle_connected": True,
            "is_enable_auto_launch": True,
            "error_flags": 9,
            "height_of_home": 12.5,
            "vz": -3.25,
            "backup_power_voltage": 8.0,
        },
    ),
    Vector(
        "vehicle_status: flyfire.VehicleStatus",
        (10, 0, 31, 16),
        "1006800a#50405600bedf",
        {"state": 2, "is_parachute_connected": True, "height_of_home": 100.0, "vz": -1.5},
    ),
    Vector(
        "trigger_launch: flyfire.TriggerLaunch",
        (10, 0, 0, 0),
        "0006810a#4c46505544c0",
        {"magic_number": 1431324236, "node_id": 34},
    ),
    Vector(
        "trigger_status: flyfire.TriggerStatus",
        (34, 0, 1, 16),
        "10068222#50038d49c1",
        {"state": 2, "is_launched": True, "error_flags": 3, "supply_voltage": 11.1015625},
    ),
    Vector(
        "deploy: flyfire.ParachuteService request",
        (10, 33, 7, 0),
        "00a3a18a#5046505505c7",
        {"magic_number": 1431324240, "type": 5},
    ),
    Vector(
        "not_now: flyfire.ParachuteService response",
        (33, 10, 7, 0),
        "00a30aa1#03c7",
        {"result": 3},
    ),
    Vector(
        "kill: flyfire.VehicleService request",
        (33, 10, 2, 0),
        "00a48aa1#5646505501c2",
        {"magic_number": 1431324246, "type": 1},
    ),
    Vector(
        "rejected: flyfire.VehicleService response", (10, 33, 2, 0), "00a4218a#01c2", {"result": 1}
    ),
    Vector(
        "launch: flyfire.TriggerService request",
        (10, 34, 3, 0),
        "00a5a28a#5446505501c3",
        {"magic_number": 1431324244, "type": 1},
    ),
    Vector(
        "bad_magic_number: flyfire.TriggerService response",
        (34, 10, 3, 0),
        "00a50aa2#04c3",
        {"result": 4},
    ),
    Vector(
        "node_status: uavcan.protocol.NodeStatus",
        (1, 0, 0, 16),
        "10015501#0403020199efbec0",
        {
            "uptime_sec": 16909060,
            "health": 2,
            "mode": 3,
            "sub_mode": 1,
            "vendor_specific_status_code": 48879,
        },
    ),
    Vector(
        "allocation_asked_for: uavcan.protocol.dynamic_node_id.Allocation",
        (0, 0, 0, 16),
        "1048d100#43000102030405c0",
        {"node_id": 33, "first_part_of_unique_id": True, "unique_id": b"\x00\x01\x02\x03\x04\x05"},
    ),
    Vector(
        "allocation_given: uavcan.protocol.dynamic_node_id.Allocation",
        (10, 0, 0, 16),
        "1000010a#8a68fa0001020380 0405060708090a20 0b0c0d0e0f40",
        {"node_id": 125, "first_part_of_unique_id": False, "unique_id": UNIT},
    ),
    Vector(
        "time: uavcan.protocol.GlobalTimeSync",
        (10, 0, 0, 8),
        "0800040a#40222018240a06c0",
        {"previous_transmission_timestamp_usec": 1700000000123456},
    ),
    Vector(
        "parameter_by_index: uavcan.protocol.param.GetSet request",
        (10, 33, 1, 16),
        "100ba18a#0500c1",
        {"index": 5, "value": {"empty": {}}, "name": b""},
    ),
    Vector(
        "parameter_by_name: uavcan.protocol.param.GetSet request",
        (10, 33, 1, 16),
        "100ba18a#3b500000456e6181 626c652041505361",
        {"index": 0, "value": {"empty": {}}, "name": b"Enable APS"},
    ),
    Vector(
        "parameter_set: uavcan.protocol.param.GetSet request",
        (10, 33, 1, 16),
        "100ba18a#0f330001feffff81 ffffffffff7861",
        {"index": 0, "value": {"integer_value": -2}, "name": b"x"},
    ),
    Vector(
        "parameter_told: uavcan.protocol.param.GetSet response",
        (33, 10, 1, 16),
        "100b0aa1#9e3b030104026881 69020000c03f0021 456e61626c652001 41505361",
        {
            "value": {"boolean_value": 1},
            "default_value": {"string_value": b"hi"},
            "max_value": {"real_value": 1.5},
            "min_value": {"empty": {}},
            "name": b"Enable APS",
        },
    ),
    Vector("who_is: uavcan.protocol.GetNodeInfo request", (10, 33, 0, 24), "1801a18a#c0", {}),
    Vector(
        "who_it_is: uavcan.protocol.GetNodeInfo response",
        (33, 10, 0, 24),
        "18010aa1#fd51070000000080 0000030000000020 0000000000000000 0000000100000120 "
        "0203040506070800 090a0b0c0d0e0f20 006f72672e746500 737460",
        {
            "status": {
                "uptime_sec": 7,
                "health": 0,
                "mode": 0,
                "sub_mode": 0,
                "vendor_specific_status_code": 0,
            },
            "software_version": {
                "major": 3,
                "minor": 0,
                "optional_field_flags": 0,
                "vcs_commit": 0,
                "image_crc": 0,
            },
            "hardware_version": {
                "major": 1,
                "minor": 0,
                "unique_id": UNIT,
                "certificate_of_authenticity": b"",
            },
            "name": b"org.test",
        },
    ),
    Vector(
        "save: uavcan.protocol.param.ExecuteOpcode request",
        (10, 33, 0, 16),
        "100aa18a#00ffffffffffffc0",
        {"opcode": 0, "argument": -1},
    ),
    Vector(
        "saved: uavcan.protocol.param.ExecuteOpcode response",
        (33, 10, 0, 16),
        "100a0aa1#02000000000080c0",
        {"argument": 2, "ok": True},
    ),
    Vector(
        "restart: uavcan.protocol.RestartNode request",
        (10, 33, 0, 16),
        "1005a18a#1e1b55ceacc0",
        {"magic_number": 742196058910},
    ),
    Vector(
        "restarts: uavcan.protocol.RestartNode response",
        (33, 10, 0, 16),
        "10050aa1#80c0",
        {"ok": True},
    ),
    Vector(
        "statistics: uavcan.protocol.GetTransportStats response",
        (33, 10, 0, 16),
        "10040aa1#7c59010000000080 0002000000000020 03000000000040",
        {"transfers_tx": 1, "transfers_rx": 2, "transfer_errors": 3, "can_iface_stats": ()},
    ),
    Vector(
        "statistics_of_two_buses: uavcan.protocol.GetTransportStats response",
        (33, 10, 0, 16),
        "10040aa1#4fc2010000000080 0002000000000020 0300000000000100 0000000000020020 "
        "0000000003000000 0000000400000020 0000050000000000 00ffffffffffff60",
        {
            "transfers_tx": 1,
            "transfers_rx": 2,
            "transfer_errors": 3,
            "can_iface_stats": (
                {"frames_tx": 1, "frames_rx": 2, "errors": 3},
                {"frames_tx": 4, "frames_rx": 5, "errors": 281474976710655},
            ),
        },
    ),
]
