"""The services of umbilical besides arm and deploy: commands by name, the target, dumps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from chute_msgs.srv import Dump, SetTarget, UmbilicalCommand

from chute_ros.links.umbilical.dump_files import DumpResult

if TYPE_CHECKING:
    from chute_ros.links.umbilical.node import UmbilicalNode

MEMORIES = ("flash", "fram")


class UmbilicalServices:
    """Offers them on node."""

    def __init__(self, node: UmbilicalNode) -> None:
        self._node = node
        #: Where a dump that was asked for is to go, by its request.
        self.dump_paths: dict[int, str] = {}
        #: What became of it.
        self.dump_results: dict[int, DumpResult] = {}
        node.serve(UmbilicalCommand, "~/command", self._command)
        node.serve(SetTarget, "~/set_target", self._set_target)
        node.serve(Dump, "~/dump", self._dump)

    async def _command(self, request: Any, response: Any) -> Any:
        log = self._node.get_logger()
        log.warning(
            f"~/command {request.command!r} called (force={request.force}): {request.reason!r}"
        )
        end = await self._node.request(
            lambda link, token, now: link.command(token, request.command, request.force, now)
        )
        _fill(response, end.finished)
        result = self.dump_results.pop(end.finished.token, None)
        if result is not None:
            response.success = response.success and not result.failure
            response.message += f"; {result.failure or f'written to {result.path}'}"
        return response

    async def _set_target(self, request: Any, response: Any) -> Any:
        values = [request.latitude, request.longitude, request.third, request.fourth]
        # What is left out of a request is 0, and no point of the sea off Africa.
        if all(math.isnan(value) or value == 0.0 for value in values[2:]):
            del values[2:]
        end = await self._node.request(
            lambda link, token, now: link.set_target(token, tuple(values), now)
        )
        return _fill(response, end.finished)

    async def _dump(self, request: Any, response: Any) -> Any:
        if request.memory not in MEMORIES:
            response.message = f"memory {request.memory!r}: need one of {', '.join(MEMORIES)}"
            return response
        if refusal := self._node.files.refusal(request.path):
            response.message = f"{refusal}; nothing was sent"
            return response

        def begin(link: Any, token: int, now: float) -> None:
            self.dump_paths[token] = request.path
            link.command(token, f"dump_{request.memory}", False, now)

        finished = (await self._node.request(begin)).finished
        self.dump_paths.pop(finished.token, None)
        result = self.dump_results.pop(finished.token, DumpResult("", 0))
        response.success = finished.success and not result.failure
        response.path_written, response.size = result.path, result.size
        response.message = "; ".join(filter(None, (finished.message, result.failure)))
        return response


def _fill(response: Any, finished: Any) -> Any:
    """The fields that the answers to a command share."""
    response.success, response.sent = finished.success, finished.sent
    response.confirmed, response.message = finished.shown, finished.message
    return response
