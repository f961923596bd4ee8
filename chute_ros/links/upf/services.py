"""The services of upf_can besides arm and deploy: its requests, parameters, memory, who it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from chute_msgs.srv import (
    GetNodeInfo,
    GetParam,
    ListParams,
    NodeRequest,
    SetParam,
    TransportStats,
    UpfCommand,
)

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p

if TYPE_CHECKING:
    from chute_ros.links.upf.node import UpfCanNode

_COMMANDS = {
    UpfCommand.Request.TAKEOFF: "TYPE_TAKEOFF",
    UpfCommand.Request.ARM: "TYPE_ARM",
    UpfCommand.Request.DISARM: "TYPE_DISARM",
    UpfCommand.Request.LAND: "TYPE_LAND",
    UpfCommand.Request.DEPLOY: "TYPE_DEPLOY",
    UpfCommand.Request.DEPLOY_FORCE: "TYPE_DEPLOY_FORCE",
}


class UpfServices:
    """Offers them on node."""

    def __init__(self, node: UpfCanNode) -> None:
        self._node = node
        for kind, name, callback in (
            (UpfCommand, "command", self._command),
            (GetParam, "get_param", self._get_param),
            (SetParam, "set_param", self._set_param),
            (ListParams, "list_params", self._list_params),
            (NodeRequest, "save_params", self._save),
            (NodeRequest, "erase_params", self._erase),
            (NodeRequest, "restart", self._restart),
            (TransportStats, "transport_stats", self._transport_stats),
            (GetNodeInfo, "get_node_info", self._node_info),
        ):
            node.serve(kind, f"~/{name}", callback)

    async def _command(self, request: Any, response: Any) -> Any:
        type_name = _COMMANDS.get(request.command)
        if type_name is None:
            known = ", ".join(f"{n} {name}" for n, name in _COMMANDS.items())
            response.message = f"command {request.command}: need one of {known}"
            return response
        self._record(f"command {type_name}", request)
        end = await self._node.request(
            lambda link, token, now: link.service(token, type_name, request.node_id, now)
        )
        return _fill(response, end.finished)

    async def _get_param(self, request: Any, response: Any) -> Any:
        done = await self._bus_request(
            request, lambda node_id: bus_requests.get_parameter(node_id, request.name)
        )
        _fill(response, done)
        for one in done.parameters:
            response.value, response.type = p.words(one.value), one.kind
            response.minimum, response.maximum = p.words(one.minimum), p.words(one.maximum)
            response.default_value = p.words(one.default)
        return response

    async def _set_param(self, request: Any, response: Any) -> Any:
        self._node.get_logger().warning(
            f"~/set_param {request.name!r} = {request.value!r} (force={request.force})"
        )
        end = await self._node.request(
            lambda link, token, now: link.set_parameter(
                token, request.node_id, request.name, request.value, request.force, now
            )
        )
        _fill(response, end.done)
        for one in end.done.parameters:
            response.value_read_back = p.words(one.value)
        return response

    async def _list_params(self, request: Any, response: Any) -> Any:
        done = await self._bus_request(request, bus_requests.list_parameters)
        _fill(response, done)
        response.names = [one.name for one in done.parameters]
        response.values = [p.words(one.value) for one in done.parameters]
        return response

    async def _save(self, request: Any, response: Any) -> Any:
        self._record("save_params", request)
        done = await self._bus_request(
            request, lambda node_id: bus_requests.execute_opcode(node_id, bus_requests.OPCODE_SAVE)
        )
        return _fill(response, done)

    async def _erase(self, request: Any, response: Any) -> Any:
        def make(node_id: int) -> bus_requests.BusRequest:
            return bus_requests.execute_opcode(node_id, bus_requests.OPCODE_ERASE)

        return await self._disturb("erase_params", request, response, make)

    async def _restart(self, request: Any, response: Any) -> Any:
        return await self._disturb("restart", request, response, bus_requests.restart)

    async def _transport_stats(self, request: Any, response: Any) -> Any:
        done = await self._bus_request(request, bus_requests.transport_stats)
        _fill(response, done)
        for name in ("transfers_tx", "transfers_rx", "transfer_errors"):
            setattr(response, name, done.values.get(name, 0))
        return response

    async def _node_info(self, request: Any, response: Any) -> Any:
        done = await self._bus_request(request, bus_requests.node_info)
        _fill(response, done)
        if not done.values:
            return response
        software, hardware = done.values["software_version"], done.values["hardware_version"]
        response.name = bytes(done.values["name"]).decode("utf-8", "replace")
        response.software_version = f"{software['major']}.{software['minor']}"
        response.hardware_version = f"{hardware['major']}.{hardware['minor']}"
        response.unique_id = bytes(hardware["unique_id"]).hex()
        response.uptime = done.values["status"]["uptime_sec"]
        response.health = done.values["status"]["health"]
        return response

    # -- inside ---------------------------------------------------------------------------------

    async def _bus_request(self, request: Any, make: Any) -> bus_requests.BusRequestDone:
        end = await self._node.request(
            lambda link, token, now: link.bus_request(token, request.node_id, make, now)
        )
        done: bus_requests.BusRequestDone = end.done
        return done

    async def _disturb(self, name: str, request: Any, response: Any, make: Any) -> Any:
        self._record(name, request)
        end = await self._node.request(
            lambda link, token, now: link.disturb(token, request.node_id, request.force, make, now)
        )
        return _fill(response, end.done)

    def _record(self, what: str, request: Any) -> None:
        """Who wants it and why, in the log."""
        self._node.get_logger().warning(f"~/{what} called: {request.reason!r}")


def _fill(response: Any, end: Any) -> Any:
    """The fields that all answers share."""
    response.success, response.message = end.success, end.message
    return response
