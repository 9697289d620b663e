"""Decides about every HTTP request and websocket upgrade before viser sees it."""

from __future__ import annotations

import asyncio
import contextlib
import http
import http.cookies
import ipaddress
import logging
import math
import secrets
import socket
import urllib.parse
from collections.abc import Awaitable, Callable, Sequence
from importlib import resources

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from oasisview.assets import ASSET_PREFIX, AssetSource
from oasisview.login import SESSION_SECONDS, LoginThrottle, NameCookie, cleaned_name, same_secret

logger = logging.getLogger(__name__)

ProcessRequest = Callable[[ServerConnection, Request], Awaitable[Response | None] | Response | None]

LOOPBACK_NAMES = ("127.0.0.1", "localhost", "[::1]")
LOGIN_PATH = "/login"
VERIFY_PATH = "/login/verify"
SECURITY_HEADERS = {
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
# The stock page of viser needs inline scripts, blob workers and wasm: only framing can be forbidden there.
PAGE_POLICY = "frame-ancestors 'none'"


def reply(status: http.HTTPStatus, body: str | bytes = b"", **headers: str) -> Response:
    """A complete, uncached plain-text answer; header names are written with underscores."""
    data = body.encode() if isinstance(body, str) else body
    fields = {
        "Content-Type": "text/plain; charset=utf-8",
        "Content-Length": str(len(data)),
        "Cache-Control": "no-store",
        **SECURITY_HEADERS,
        **{name.replace("_", "-"): value for name, value in headers.items()},
    }
    return Response(status.value, status.phrase, Headers(fields), data)


class RequestGuard:
    """The checks of one server.

    Args:
        port: the bound port.
        token: what a login has to give; None = nobody has to log in (loopback).
        assets: where ``/asset/<key>`` comes from.
        allowed_hosts: names by which browsers may address the server, besides those of the machine.
    """

    def __init__(
        self, *, port: int, token: str | None, assets: AssetSource | None, allowed_hosts: Sequence[str] = ()
    ) -> None:
        self.token = token
        self.port = port
        self.cookie = NameCookie()
        self.throttle = LoginThrottle()
        self._assets = assets
        self._allowed_hosts = frozenset(name.lower() for name in allowed_hosts)
        self._machine = socket.gethostname().partition(".")[0].lower()
        # Cookies do not tell ports apart: two viewers on one machine must not log each other out.
        self.cookie_name = f"oasisview_{port}"

    def name_in(self, headers: Headers) -> str | None:
        """The name that the cookie of a request carries, if the cookie is ours and still valid."""
        jar = http.cookies.SimpleCookie()
        with contextlib.suppress(http.cookies.CookieError):
            jar.load(headers.get("Cookie", ""))
        morsel = jar.get(self.cookie_name)
        return None if morsel is None else self.cookie.read(morsel.value)

    def wrap(self, serve_page: ProcessRequest) -> ProcessRequest:
        """Viser's own ``process_request`` behind the checks."""

        async def guarded(connection: ServerConnection, request: Request) -> Response | None:
            try:
                answer = await self._answer(connection, request)
                if answer is not None:
                    return answer
                page = serve_page(connection, request)
                page = await page if isinstance(page, Awaitable) else page
            except Exception as error:  # whatever goes wrong in a check must refuse, not let through
                logger.debug("refused a request", exc_info=error)
                return reply(http.HTTPStatus.BAD_REQUEST, "bad request")
            if page is not None:
                page.headers.update(SECURITY_HEADERS)
                page.headers["Content-Security-Policy"] = PAGE_POLICY
                # The page and its script change together with the server: always ask again.
                page.headers["Cache-Control"] = "no-cache"
            return page

        return guarded

    async def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer of the guard itself; None lets viser answer."""
        host = request.headers.get("Host", "")
        if not self.is_known_host(host):
            return reply(
                http.HTTPStatus.MISDIRECTED_REQUEST,
                f"This server does not answer to that name. Open it as {LOOPBACK_NAMES[0]}:{self.port}, "
                "forwarding the same port number if you use a tunnel.",
            )
        url = urllib.parse.urlsplit(request.path)
        is_websocket = "websocket" in request.headers.get("Upgrade", "").lower()
        if not is_websocket and url.path == VERIFY_PATH:
            return self._verify(connection.remote_address[0], request.headers)
        if not is_websocket and url.path == LOGIN_PATH:
            return self._login_page()
        if self.token is not None and self.name_in(request.headers) is None:
            if not is_websocket and url.path == "/" and "text/html" in request.headers.get("Accept", ""):
                # The query goes along, so that a link to an object survives the login.
                target = LOGIN_PATH + (f"?{url.query}" if url.query else "")
                return reply(http.HTTPStatus.SEE_OTHER, Location=target)
            return reply(http.HTTPStatus.UNAUTHORIZED, f"Log in at {LOGIN_PATH} first.")
        if is_websocket:
            if not is_same_origin(request.headers.get("Origin", ""), host):
                return reply(http.HTTPStatus.FORBIDDEN, "websocket from another origin")
            return None
        if url.path.startswith(ASSET_PREFIX):
            return await self._asset(urllib.parse.unquote(url.path[len(ASSET_PREFIX) :]))
        return None

    def is_known_host(self, host: str) -> bool:
        """Whether the Host header names this server: other names are how DNS rebinding gets in."""
        name, port = split_host(host.lower())
        if name in self._allowed_hosts:
            return True
        if self.token is None:
            return name in LOOPBACK_NAMES and (port == self.port or (port is None and self.port == 80))
        if name in LOOPBACK_NAMES or name.partition(".")[0] == self._machine:
            return True
        with contextlib.suppress(ValueError):
            return bool(ipaddress.ip_address(name.strip("[]")))
        return False

    def _login_page(self) -> Response:
        if self.token is None:
            return reply(http.HTTPStatus.SEE_OTHER, Location="/")
        nonce = secrets.token_urlsafe(16)
        page = resources.files("web_assets").joinpath("login.html").read_text("utf-8")
        return reply(
            http.HTTPStatus.OK,
            page.replace("{{nonce}}", nonce),
            Content_Type="text/html; charset=utf-8",
            Content_Security_Policy=(
                f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; "
                "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
            ),
        )

    def _verify(self, address: str, headers: Headers) -> Response:
        """Answer a login: token and name come in headers, which no other site can set unasked."""
        if self.token is None:
            return reply(http.HTTPStatus.NO_CONTENT)
        wait_s = self.throttle.wait_s(address)
        if wait_s > 0:
            seconds = str(math.ceil(wait_s))
            return reply(http.HTTPStatus.TOO_MANY_REQUESTS, "Too many wrong tokens.", Retry_After=seconds)
        scheme, _, given = headers.get("Authorization", "").partition(" ")
        if scheme != "Bearer" or not same_secret(urllib.parse.unquote(given), self.token):
            self.throttle.failed(address)
            return reply(http.HTTPStatus.UNAUTHORIZED, "wrong token")
        name = cleaned_name(urllib.parse.unquote(headers.get("X-Inspector", "")))
        if name is None:
            return reply(http.HTTPStatus.UNPROCESSABLE_ENTITY, "a name is needed")
        self.throttle.succeeded(address)
        cookie = f"{self.cookie_name}={self.cookie.issue(name)}; HttpOnly; SameSite=Strict; Path=/"
        return reply(http.HTTPStatus.NO_CONTENT, Set_Cookie=f"{cookie}; Max-Age={SESSION_SECONDS}")

    async def _asset(self, key: str) -> Response:
        # On a worker thread: encoding an image must not hold up the other browsers.
        try:
            asset = None if self._assets is None else await asyncio.to_thread(self._assets.get, key)
        except Exception:
            logger.exception("the asset %r could not be made", key)
            return reply(http.HTTPStatus.INTERNAL_SERVER_ERROR, "this image could not be made")
        if asset is None:
            return reply(http.HTTPStatus.NOT_FOUND, "no such image")
        return reply(
            http.HTTPStatus.OK,
            asset.data,
            Content_Type=asset.content_type,
            Cache_Control="private, max-age=31536000, immutable",
        )


def split_host(host: str) -> tuple[str, int | None]:
    """Name and port of a Host header; IPv6 addresses keep their brackets. Nonsense gives an empty name."""
    name, colon, port = host.rpartition(":")
    if not colon or port.endswith("]"):
        return host, None
    return (name, int(port)) if port.isascii() and port.isdigit() and len(port) <= 5 else ("", None)


def is_same_origin(origin: str, host: str) -> bool:
    """Whether the page that opens a websocket came from this very server."""
    parts = urllib.parse.urlsplit(origin)
    return bool(host) and parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower()
