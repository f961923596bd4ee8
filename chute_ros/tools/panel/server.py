"""The web server of the panel: NiceGUI in a thread of its own."""

from __future__ import annotations

import ipaddress
import os
import socket
import ssl
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import Client, app, core, ui
from nicegui.server import Server
from starlette.responses import PlainTextResponse

from chute_ros.errors import ParameterError
from chute_ros.tools.panel import fleet_page, login_page, vehicle_page
from chute_ros.tools.panel.border import Border, own_names
from chute_ros.tools.panel.plain_log import plain_log_of

if TYPE_CHECKING:
    from chute_ros.tools.panel.node import PanelNode

#: A browser that is away for so long is looked after no more, s: its vehicle costs nothing then.
_RECONNECT = 5.0
_END = 5.0
#: A page that was sent and never used is dropped after so long; looked after so often, s.
_UNUSED, _PRUNES = 10.0, 5.0
_ANY = ("0.0.0.0", "::")


class PanelServer:
    """Of this node. One in a process, as NiceGUI has it."""

    def __init__(self, node: PanelNode) -> None:
        self._node = node
        settings = node.settings
        self.secure = bool(settings.certificate_file)
        if self.secure:
            _check_certificate(settings.certificate_file, settings.key_file)
        #: From now on browsers are queued, until the server takes them.
        self._socket = _listening(settings.host, settings.port)
        self._thread = threading.Thread(target=self._run, name="web server", daemon=True)

    @property
    def address(self) -> str:
        """For the browser of this computer, or of others where they are let in."""
        settings = self._node.settings
        host = socket.gethostname() if settings.host in _ANY else settings.host
        host = f"[{host}]" if ":" in host else host
        return f"{'https' if self.secure else 'http'}://{host}:{settings.port}/"

    def start(self) -> None:
        """Serve until stop."""
        names = own_names([*self._node.settings.host_names, self._node.settings.host])
        app.add_middleware(Border, names=names, pages=lambda: len(Client.instances))
        app.add_exception_handler(404, _nothing_here)
        # Pages that no browser came back for.
        app.timer(_PRUNES, lambda: Client.prune_instances(client_age_threshold=_UNUSED))
        # Any visitor may send it, and it would be a line of the log.
        core.sio.on("log", lambda *_: None)
        plain_log_of("nicegui", "uvicorn.error", "asyncio", "socketio", "engineio")
        folder = Path(__file__).parent
        for tag, name in (("style", "panel.css"), ("script", "panel.js")):
            ui.add_head_html(f"<{tag}>{(folder / name).read_text()}</{tag}>", shared=True)
        login_page.register(self._node, self.secure)
        fleet_page.register(self._node)
        vehicle_page.register(self._node)
        app.on_startup(self._tell)
        self._thread.start()

    def stop(self) -> None:
        """End it, with every page that is open."""
        if (server := getattr(Server, "instance", None)) is not None:
            server.should_exit = True
        self._thread.join(_END)
        self._socket.close()

    def _run(self) -> None:
        settings = self._node.settings
        try:
            ui.run(
                host=settings.host,
                port=settings.port,
                fd=self._socket.fileno(),
                title="chute_ros",
                favicon=str(Path(__file__).parent / "panel.svg"),
                dark=None,
                reload=False,
                show=False,
                show_welcome_message=False,
                tailwind=False,
                binding_refresh_interval=None,
                reconnect_timeout=_RECONNECT,
                timeout_graceful_shutdown=1,
                language="en-US",
                # Anybody may write that header.
                proxy_headers=False,
                ssl_certfile=settings.certificate_file or None,
                ssl_keyfile=settings.key_file or None,
            )
        except SystemExit:
            self._node.get_logger().fatal(f"the web server at {self.address} could not start")

    def _tell(self) -> None:
        node = self._node
        log = node.get_logger()
        log.info(f"panel at {self.address}")
        settings = node.settings
        if settings.allow_commands and not self.secure and not _is_loopback(settings.host):
            log.warning(
                "passwords and orders are sent in clear text: set certificate_file and key_file, "
                "or keep strangers from this network"
            )


async def _nothing_here(*_: object) -> PlainTextResponse:
    return PlainTextResponse("There is no such page: / has all vehicles.\n", 404)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _listening(host: str, port: int) -> socket.socket:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family)
    except OSError as error:
        raise ParameterError(
            f"parameters host and port are {host} and {port}: {os.strerror(error.errno or 0)}; "
            "name others, or end what listens there"
        ) from None


def _check_certificate(certificate_file: str, key_file: str) -> None:
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate_file, key_file)
    except OSError as error:
        raise ParameterError(
            f"parameters certificate_file and key_file: {error} ({certificate_file}, {key_file})"
        ) from None
