"""The dronecan library by itself: encodes and decodes what it is given, knows nothing of ours.

A program: the folder of our types is its argument, tasks come as JSON and results go as JSON. It
has a process of its own because load_dsdl rebuilds every type of the library.

A task {"name", "mode", "values", "source", "destination", "transfer_id", "priority",
"discriminator"} gives {"payload", "frames", "signature"}; bytes are hex, in values {"hex": ...};
a frame is [identifier, data]. A task {"frames": [...]} gives its values in words, or the error.
"""

import json
import sys

import dronecan
from dronecan import transport


def fill(value, values):
    for name, one in values.items():
        if isinstance(one, dict) and "hex" in one:
            getattr(value, name).from_bytes(bytes.fromhex(one["hex"]))
        elif isinstance(one, dict):
            if transport.is_union(value):
                transport.switch_union_field(value, name)
            fill(getattr(value, name), one)
        elif isinstance(one, list):
            items = getattr(value, name)
            for item in one:
                items.append(items.new_item())
                fill(items[-1], item)
        else:
            setattr(value, name, one)


def encode(task):
    mode = task.get("mode")
    value = transport.CompoundValue(dronecan.TYPENAMES[task["name"]], _mode=mode)
    fill(value, task["values"])
    transfer = transport.Transfer(
        payload=value,
        source_node_id=task.get("source", 1),
        dest_node_id=task.get("destination"),
        transfer_id=task.get("transfer_id", 0),
        transfer_priority=task.get("priority", 16),
        service_not_message=mode is not None,
        request_not_response=mode == "request",
        discriminator=task.get("discriminator"),
    )
    return {
        "payload": bytes(transfer.payload).hex(),
        "frames": [[one.message_id, bytes(one.bytes).hex()] for one in transfer.to_frames()],
    }


def decode(task):
    frames = [transport.Frame(number, bytes.fromhex(data)) for number, data in task["frames"]]
    transfer = transport.Transfer()
    transfer.from_frames(frames)
    return {
        "text": repr(transfer.payload),
        "source": transfer.source_node_id,
        "destination": transfer.dest_node_id,
        "transfer_id": transfer.transfer_id,
        "priority": transfer.transfer_priority,
    }


if __name__ == "__main__":
    dronecan.load_dsdl(sys.argv[1])
    tasks = json.load(sys.stdin)
    json.dump([decode(one) if "frames" in one else encode(one) for one in tasks], sys.stdout)
