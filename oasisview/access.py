"""Who may come in: a viser server that guards page, websocket and images on its one port.

Viser calls ``websockets.asyncio.server.serve(process_request=...)`` once while it is constructed, and
``process_request`` sees the page and the websocket upgrade alike: wrapping that one call guards both. The
server tries its own guards when it starts and refuses to serve if any of them did not take hold, for
example because another version of viser goes another way.
"""

from __future__ import annotations

import contextlib
import errno
import getpass
import ipaddress
import logging
import socket
import threading
import urllib.parse
from collections.abc import Iterator, Sequence
from typing import Any

import rich
import viser
import websockets.asyncio.server as websockets_server
from viser import _messages

from oasisview import message_guard
from oasisview.assets import AssetSource
from oasisview.login import checked_token
from oasisview.request_guard import RequestGuard
from pipeline.errors import InputError, OasisError

_construction_lock = threading.Lock()


class GuardedServer(viser.ViserServer):
    """A viser server that decides who may load the page, open a websocket or fetch an asset.

    Args:
        host: address to listen on. Loopback demands no token; any other address does.
        port: TCP port; 0 picks a free one (``get_port()`` tells). Taken: ``InputError``, never another.
        token: what people log in with. None: none on loopback, a generated one elsewhere.
        assets: where ``/asset/<key>`` comes from; None: no assets.
        allowed_hosts: further names by which browsers may address the server (``Host`` header).
        label: title of the control panel.

    Raises:
        InputError: the port is taken, the host is not an address of this machine, or the token is weak.
        OasisError: the guards could not be put in force; nothing is served then.
    """

    def __init__(
        self,
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        token: str | None = None,
        assets: AssetSource | None = None,
        allowed_hosts: Sequence[str] = (),
        label: str | None = None,
    ) -> None:
        listener, address = _bind(host, port)
        try:
            demanded = token is not None or not ipaddress.ip_address(address).is_loopback
            self.token = checked_token(token) if demanded else None
            self.guard = RequestGuard(
                port=listener.getsockname()[1], token=self.token, assets=assets, allowed_hosts=allowed_hosts
            )
            self._system_user = _system_user()
            self._users: dict[int, str] = {}
            message_guard.install()
            with _construction_lock, _quiet_console(), _serving_through(self.guard, listener):
                super().__init__(host=address, port=self.guard.port, label=label, verbose=False)
        except BaseException:
            listener.close()
            raise
        for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            self._websock_server.unregister_handler(message)
        try:
            self._check_guards()
        except BaseException:
            self.stop()
            raise

    @property
    def url(self) -> str:
        """Address of the page, without any secret."""
        host = self.get_host()
        if ipaddress.ip_address(host).is_unspecified:
            host = socket.gethostname()
        return f"http://{f'[{host}]' if ':' in host else host}:{self.get_port()}/"

    @property
    def login_url(self) -> str:
        """Address to open in a browser.

        A demanded token is in the fragment, which browsers never send: it reaches no log and no referrer.
        """
        if self.token is None:
            return self.url
        return f"{self.url}login#{urllib.parse.quote(self.token, safe='')}"

    def user_of_client(self, client_id: int) -> str:
        """Name of the person behind a client: from the login, else the system user on loopback.

        Raises:
            KeyError: no client with that id ever connected.
        """
        if self.token is None:
            return self._system_user
        connection = self._websock_server._live_connections.get(client_id)
        if connection is not None and client_id not in self._users:
            # A cookie may run out while its tab stays open; the name at the time of connecting counts.
            name = None if connection.request is None else self.guard.name_in(connection.request.headers)
            self._users[client_id] = name or "unknown"
        return self._users[client_id]

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refused: it would open a public tunnel to the site's recordings."""
        raise OasisError("this server opens no public tunnel", "use your own network or ssh instead")

    def stop(self) -> None:
        """Stop serving and disconnect everybody."""
        with _quiet_console():
            super().stop()

    def _check_guards(self) -> None:
        """Try the guards from outside, as a stranger.

        Raises:
            OasisError: one of them let something through.
        """
        here = f"127.0.0.1:{self.guard.port}"
        upgrade = {
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
        }
        own, evil = {"Origin": f"http://{here}"}, {"Origin": "http://evil.example"}
        expected: list[tuple[str, dict[str, str], int]] = [
            ("/", {"Host": "evil.example"}, 421),
            ("/asset/x", {"Host": "evil.example"}, 421),
            ("/", {"Host": "evil.example", **upgrade, "Origin": "http://evil.example"}, 421),
        ]
        if self.token is None:
            expected += [("/", {"Host": here, **upgrade, **evil}, 403), ("/", {"Host": here, **upgrade}, 403)]
        else:
            expected += [
                ("/", {"Host": here}, 401),
                ("/asset/x", {"Host": here}, 401),
                ("/", {"Host": here, **upgrade, **own}, 401),
            ]
        handlers = self._websock_server._incoming_handlers
        in_force = (
            message_guard.is_in_force()
            and _messages.ShareUrlRequest not in handlers
            and _messages.ShareUrlDisconnect not in handlers
            and all(self._status(path, headers) == status for path, headers, status in expected)
        )
        if not in_force:
            raise OasisError(
                "the viewer's access checks are not in force, so nothing is served",
                f"install viser 1.1.1 (found {viser.__version__})",
            )

    def _status(self, path: str, headers: dict[str, str]) -> int:
        address = ipaddress.ip_address(self.get_host())
        if address.is_unspecified:
            address = ipaddress.ip_address("::1" if address.version == 6 else "127.0.0.1")
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        try:
            with socket.create_connection((str(address), self.guard.port), timeout=5) as connection:
                connection.sendall(f"GET {path} HTTP/1.1\r\n{lines}\r\n".encode())
                return int(connection.makefile("rb").readline().split()[1])
        except (OSError, IndexError, ValueError):
            return 0


def _bind(host: str, port: int) -> tuple[socket.socket, str]:
    """A bound socket for viser to listen on, and its numeric address.

    Binding here, and not by viser, is what keeps it from trying the next thousand ports by itself.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"port {port} does not exist", "choose one from 1 to 65535, or 0 for any free one")
    try:
        # "localhost" is IPv4 here: one address, one socket.
        family = socket.AF_INET if host == "localhost" else socket.AF_UNSPEC
        found = socket.getaddrinfo(host or "0.0.0.0", port, family, socket.SOCK_STREAM)
        family, _, _, _, where = found[0]
    except (OSError, UnicodeError):
        raise InputError(
            f"there is no host {host!r}", "use 127.0.0.1, or an address of this machine"
        ) from None
    address = str(where[0])
    everywhere = family == socket.AF_INET6 and ipaddress.ip_address(address).is_unspecified
    try:
        listener = socket.create_server(
            where[:2], family=family, dualstack_ipv6=everywhere and socket.has_dualstack_ipv6()
        )
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise InputError(
                f"port {port} on {host} is already in use", "close the other program or choose another --port"
            ) from None
        if error.errno in (errno.EACCES, errno.EPERM):
            raise InputError(f"port {port} may not be used", "choose a --port above 1023") from None
        raise InputError(
            f"cannot listen on {host!r}", "use 127.0.0.1, or an address of this machine"
        ) from None
    return listener, address


@contextlib.contextmanager
def _serving_through(guard: RequestGuard, listener: socket.socket) -> Iterator[None]:
    """While viser starts: its ``serve`` goes through the guard and listens on our socket."""
    stock_serve = websockets_server.serve

    def serve(handler: Any, host: str, port: int, *, process_request: Any = None, **options: Any) -> Any:
        return stock_serve(
            handler, sock=listener, process_request=guard.wrap(process_request), logger=_logger(), **options
        )

    setattr(websockets_server, "serve", serve)  # noqa: B010
    try:
        yield
    finally:
        setattr(websockets_server, "serve", stock_serve)  # noqa: B010


class _NotAboutStrangers(logging.Filter):
    def filter(self, record: logging.LogRecord) -> bool:
        # Port scanners and aborted page loads are no news, and their tracebacks hide what is.
        return "opening handshake failed" not in record.getMessage()


def _logger() -> logging.Logger:
    logger = logging.getLogger("oasisview.websockets")
    if not any(isinstance(known, _NotAboutStrangers) for known in logger.filters):
        logger.addFilter(_NotAboutStrangers())
    return logger


@contextlib.contextmanager
def _quiet_console() -> Iterator[None]:
    """Viser prints a start panel and "Server stopped" whatever it is told; standard output is ours."""
    console = rich.get_console()
    was_quiet = console.quiet
    console.quiet = True
    try:
        yield
    finally:
        console.quiet = was_quiet


def _system_user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a container without a user database
        return "inspector"
