"""Looks at one page of the panel as a browser does, but draws nothing: bench.page_viewer ADDRESS.

A browser on this computer would take more of it than all that is measured; in the field it is on
another.
"""

from __future__ import annotations

import asyncio
import re
import sys
import time
import urllib.request
from urllib.parse import urlencode, urlsplit

import socketio

from bench.at_terminal import LOOKS

_TRIES, _EVERY = 60, 0.5  # s


async def look(address: str) -> None:
    """Until the end."""
    client = socketio.AsyncClient()
    parts = urlsplit(address)
    query = urlencode(
        {
            "client_id": _client_id(address),
            "next_message_id": 0,
            "implicit_handshake": "true",
            "document_id": "bench",
            "tab_id": "bench",
            "old_tab_id": "null",
        }
    )
    await client.connect(
        f"{parts.scheme}://{parts.netloc}?{query}",
        socketio_path="/_nicegui_ws/socket.io",
        transports=["websocket"],
    )
    print(LOOKS, flush=True)
    await client.wait()


def _client_id(address: str) -> str:
    """Of the page, once it shows a vehicle."""
    for _ in range(_TRIES):
        try:
            with urllib.request.urlopen(address, timeout=10.0) as answer:
                text = answer.read().decode()
            found = re.search(r"['\"]client_id['\"]: ?['\"]([\w-]+)", text)
            if found and "No supervisor is found" not in text:
                return found[1]
        except OSError:
            pass  # it has not started yet
        time.sleep(_EVERY)
    sys.exit(f"{address} shows no vehicle")


if __name__ == "__main__":
    asyncio.run(look(sys.argv[1]))
