"""The table of unique id to node id on the disk. It survives a crash in the middle of writing."""

from __future__ import annotations

import json
from collections.abc import Mapping

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.allocation import HIGHEST, LOWEST, UNIQUE_ID_LENGTH
from chute_ros.ros.private_files import read_own_text, replace_text
from chute_ros.ros.ros_home import ros_home
from chute_ros.transport.given_path import given_path


class AllocationFile:
    """path: of the file; empty: under ROS_HOME (~/.ros), named after the node."""

    def __init__(self, path: str, node_name: str) -> None:
        named = "parameter allocation_table_file"
        own = f"{node_name.strip('/').replace('/', '.')}.node_ids.json"
        self.path = given_path(path, named) if path else ros_home() / own

    def load(self) -> dict[bytes, int]:
        """The table; empty if there is no file. ParameterError if it cannot be believed: to begin
        anew could give a node id of one device to another."""
        try:
            text = read_own_text(self.path)
        except FileNotFoundError:
            return {}
        except (OSError, UnicodeDecodeError) as error:
            raise self._unusable(str(error)) from None
        try:
            # As pairs: a dict would hide a unique id that is there twice.
            pairs = json.loads(text, object_pairs_hook=tuple)
            entries = [(bytes.fromhex(unique_id), node_id) for unique_id, node_id in pairs]
        except (ValueError, TypeError, RecursionError):
            raise self._unusable("it holds no table of unique id to node id") from None
        if not isinstance(pairs, tuple):
            raise self._unusable("it holds no table of unique id to node id")
        for unique_id, node_id in entries:
            whole = type(node_id) is int and LOWEST <= node_id <= HIGHEST
            if len(unique_id) != UNIQUE_ID_LENGTH or not whole:
                raise self._unusable(f"{unique_id.hex()}: {node_id} is no allocation")
        table = dict(entries)
        if len(table) < len(entries):
            raise self._unusable("it names one device twice")
        if len(set(table.values())) < len(table):
            raise self._unusable("it gives one node id to two devices")
        return table

    def save(self, table: Mapping[bytes, int]) -> None:
        """It is on the disk before anybody gets the node id; OSError if that fails. The order
        stays: it tells of age."""
        text = json.dumps({key.hex(): n for key, n in table.items()}, indent=1) + "\n"
        replace_text(self.path, text, durable=True)

    def _unusable(self, why: str) -> ParameterError:
        return ParameterError(
            f"parameter allocation_table_file: {self.path} cannot be used: {why}; repair it, or "
            "move it away and start with no device on the bus"
        )
