from __future__ import annotations

import http.client
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec.msgpack
import pytest
import viser
from viser.infra import _infra
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from oasisview import message_guard, request_guard
from oasisview.access import GuardedServer
from oasisview.assets import Asset, AssetTable
from oasisview.request_guard import RequestGuard
from pipeline.errors import InputError, OasisError

TOKEN = "correct horse battery"


@pytest.fixture
def serve() -> Iterator[Callable[..., GuardedServer]]:
    servers: list[GuardedServer] = []

    def start(**options: Any) -> GuardedServer:
        servers.append(GuardedServer(port=0, **options))
        return servers[-1]

    yield start
    for server in servers:
        server.stop()


@pytest.fixture
def assets() -> AssetTable:
    table = AssetTable()
    table.register("visit 1/é.png", lambda: Asset("image/png", b"picture"))
    table.register("broken", lambda: 1 / 0)
    return table


def get(server: GuardedServer, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=10)
    connection.request(
        "GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()}
    )
    response = connection.getresponse()
    response.body = response.read()  # type: ignore[attr-defined]
    connection.close()
    return response


def login(server: GuardedServer, name: str = "Ana", token: str = TOKEN) -> http.client.HTTPResponse:
    return get(server, "/login/verify", Authorization=f"Bearer {token.replace(' ', '%20')}", X_Inspector=name)


def cookie_of(response: http.client.HTTPResponse) -> str:
    return (response.getheader("Set-Cookie") or "").partition(";")[0]


def open_websocket(
    server: GuardedServer, origin: str | None = "own", cookie: str = "", host: str | None = None
) -> ClientConnection:
    address = f"127.0.0.1:{server.get_port()}"
    return connect(
        f"ws://{host or address}/",
        sock=socket.create_connection(("127.0.0.1", server.get_port()), timeout=10),
        origin=Origin(f"http://{address}") if origin == "own" else origin and Origin(origin),
        additional_headers={"Cookie": cookie} if cookie else None,
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
        proxy=None,
    )


def refusal(*arguments: Any, **options: Any) -> int:
    with pytest.raises(InvalidStatus) as refused:
        open_websocket(*arguments, **options)
    return refused.value.response.status_code


def wait_for(condition: Callable[[], Any], timeout_s: float = 15.0) -> Any:
    end = time.monotonic() + timeout_s
    while not (value := condition()) and time.monotonic() < end:
        time.sleep(0.01)
    assert value
    return value


class TestLoopback:
    def test_page_needs_no_token_and_is_never_framed(self, serve: Callable[..., GuardedServer]) -> None:
        page = get(serve())
        assert page.status == 200
        assert page.getheader("X-Frame-Options") == "DENY"
        assert page.getheader("Content-Security-Policy") == "frame-ancestors 'none'"
        assert page.getheader("X-Content-Type-Options") == "nosniff"
        assert page.getheader("Referrer-Policy") == "no-referrer"

    @pytest.mark.parametrize(
        "host",
        ["evil.example:{port}", "127.0.0.1:1", "127.0.0.1.evil.example:{port}", "localhost:{port}:1", ""],
    )
    def test_other_host_names_are_refused(self, serve: Callable[..., GuardedServer], host: str) -> None:
        server = serve()
        assert get(server, Host=host.format(port=server.get_port())).status == 421

    @pytest.mark.parametrize(
        "host", ["127.0.0.1:{port}", "localhost:{port}", "LOCALHOST:{port}", "[::1]:{port}"]
    )
    def test_own_host_names_are_answered(self, serve: Callable[..., GuardedServer], host: str) -> None:
        server = serve()
        assert get(server, Host=host.format(port=server.get_port())).status == 200

    def test_two_host_headers_are_refused(self, serve: Callable[..., GuardedServer]) -> None:
        server = serve()
        with socket.create_connection(("127.0.0.1", server.get_port()), timeout=10) as raw:
            here = f"127.0.0.1:{server.get_port()}"
            raw.sendall(f"GET / HTTP/1.1\r\nHost: {here}\r\nHost: evil.example\r\n\r\n".encode())
            assert raw.recv(64).split()[1] == b"400"

    @pytest.mark.parametrize("origin", ["http://evil.example", None, "null", "http://127.0.0.1:1"])
    def test_websockets_of_other_pages_are_refused(
        self, serve: Callable[..., GuardedServer], origin: str | None
    ) -> None:
        assert refusal(serve(), origin) == 403

    def test_own_page_may_open_a_websocket_as_the_system_user(
        self, serve: Callable[..., GuardedServer], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("LOGNAME", "marta")
        server = serve()
        with open_websocket(server):
            wait_for(lambda: server._websock_server._live_connections)
            assert server.user_of_client(0) == "marta"

    def test_login_page_leads_to_the_viewer(self, serve: Callable[..., GuardedServer]) -> None:
        server = serve()
        assert (get(server, "/login").status, get(server, "/login").getheader("Location")) == (303, "/")
        assert server.login_url == server.url == f"http://127.0.0.1:{server.get_port()}/"


class TestToken:
    def test_strangers_get_nothing(self, serve: Callable[..., GuardedServer], assets: AssetTable) -> None:
        server = serve(host="0.0.0.0", assets=assets)
        assert server.token is not None and len(server.token) >= 24
        assert server.login_url.endswith(f"/login#{server.token}")
        assert get(server).status == 401
        assert get(server, "/asset/visit%201/%C3%A9.png").status == 401
        assert get(server, "/index.html").status == 401
        assert refusal(server) == 401
        browser = get(server, "/?object=12", Accept="text/html,*/*")
        assert (browser.status, browser.getheader("Location")) == (303, "/login?object=12")

    def test_a_given_token_is_demanded_on_loopback_too(self, serve: Callable[..., GuardedServer]) -> None:
        assert get(serve(token=TOKEN)).status == 401

    def test_a_weak_token_is_refused(self) -> None:
        with pytest.raises(InputError, match="too easy to guess"):
            GuardedServer(port=0, host="0.0.0.0", token="1234")

    def test_login_gives_a_cookie_that_opens_page_and_websocket(
        self, serve: Callable[..., GuardedServer]
    ) -> None:
        server = serve(token=TOKEN)
        answer = login(server, name="Ana%20Mar%C3%ADa")
        assert answer.status == 204
        attributes = (answer.getheader("Set-Cookie") or "").split("; ")
        assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(attributes)
        assert TOKEN not in (answer.getheader("Set-Cookie") or "")
        cookie = cookie_of(answer)
        assert get(server, Cookie=cookie).status == 200
        with open_websocket(server, cookie=cookie):
            wait_for(lambda: server._websock_server._live_connections)
            assert server.user_of_client(0) == "Ana María"
        wait_for(lambda: not server._websock_server._live_connections)
        assert server.user_of_client(0) == "Ana María", "decisions may be written after a tab has closed"
        assert refusal(server, "http://evil.example", cookie) == 403
        assert refusal(server, None, cookie) == 403

    def test_forged_cookies_are_refused(self, serve: Callable[..., GuardedServer]) -> None:
        server = serve(token=TOKEN)
        cookie = cookie_of(login(server))
        name, _, value = cookie.partition("=")
        encoded, expires, signature = value.split(".")
        later = str(int(expires) + 10**6)
        forged = [
            f"{encoded}.{later}.{signature}",
            f"Qm9i.{expires}.{signature}",
            f"{encoded}.{expires}.{'0' * len(signature)}",
            f"{encoded}.{expires}",
            "",
            "é.é.é",
        ]
        other = serve(token=TOKEN)
        assert get(server, Cookie=cookie).status == 200
        for value in forged:
            assert get(server, Cookie=f"{name}={value}".encode().decode("latin-1")).status == 401
        assert refusal(server, cookie=f"{name}={forged[0]}") == 401
        renamed = cookie.replace(str(server.get_port()), str(other.get_port()))
        assert get(other, Cookie=renamed).status == 401, "a cookie of another server with the same token"

    def test_bad_logins(self, serve: Callable[..., GuardedServer]) -> None:
        server = serve(token=TOKEN)
        assert login(server, token="wrong").status == 401
        assert get(server, "/login/verify").status == 401
        for name in ("", "%20%09", "x" * 61, "a%00b"):
            assert login(server, name=name).status == 422
        assert login(server).status == 204

    def test_guessing_is_braked(self, serve: Callable[..., GuardedServer]) -> None:
        server = serve(token=TOKEN)
        for _ in range(server.guard.throttle.FREE_ATTEMPTS):
            assert login(server, token="wrong guess").status == 401
        braked = login(server)
        assert braked.status == 429, "even the right token waits, or it could be told by the answer"
        assert int(braked.getheader("Retry-After") or 0) >= 1
        assert cookie_of(braked) == ""

    def test_hosts(self, serve: Callable[..., GuardedServer]) -> None:
        server = serve(host="0.0.0.0", allowed_hosts=["viewer.site.example"])
        machine = socket.gethostname().partition(".")[0]
        for host in (
            "192.168.1.20:8080",
            machine,
            f"{machine}.local:1",
            "viewer.site.example",
            "[fe80::1]:80",
        ):
            assert get(server, Host=host).status == 401
        assert get(server, Host="evil.example").status == 421


class TestAssets:
    def test_found_by_key_and_kept_by_browsers(
        self, serve: Callable[..., GuardedServer], assets: AssetTable
    ) -> None:
        answer = get(serve(assets=assets), "/asset/visit%201/%C3%A9.png?v=2")
        assert (answer.status, answer.body) == (200, b"picture")  # type: ignore[attr-defined]
        assert answer.getheader("Content-Type") == "image/png"
        assert answer.getheader("Cache-Control") == "private, max-age=31536000, immutable"
        assert answer.getheader("X-Content-Type-Options") == "nosniff"
        assert answer.getheader("Content-Length") == "7"

    @pytest.mark.parametrize(
        "path", ["/asset/", "/asset/none", "/asset/../access.py", "/asset/%2e%2e/%2fetc/passwd"]
    )
    def test_unknown_keys(self, serve: Callable[..., GuardedServer], assets: AssetTable, path: str) -> None:
        assert get(serve(assets=assets), path).status == 404

    def test_without_a_source(self, serve: Callable[..., GuardedServer]) -> None:
        assert get(serve(), "/asset/x").status == 404

    def test_a_failing_maker_is_the_servers_fault(
        self, serve: Callable[..., GuardedServer], assets: AssetTable
    ) -> None:
        failed = get(serve(assets=assets), "/asset/broken")
        assert failed.status == 500
        assert b"ZeroDivision" not in failed.body  # type: ignore[attr-defined]

    def test_a_slow_image_does_not_hold_up_others(self, serve: Callable[..., GuardedServer]) -> None:
        import threading

        release = threading.Event()

        class Slow:
            def get(self, key: str) -> Asset | None:
                if key == "slow":
                    assert release.wait(15)
                return Asset("text/plain", key.encode())

        server = serve(assets=Slow())
        answers: list[Any] = []
        waiting = threading.Thread(target=lambda: answers.append(get(server, "/asset/slow")))
        waiting.start()
        assert get(server, "/asset/quick").status == 200
        assert get(server).status == 200
        assert answers == []
        release.set()
        waiting.join(15)
        assert answers[0].body == b"slow"


CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 0.0, 0.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 100.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


class TestMessages:
    def test_clients_may_only_set_values(
        self, serve: Callable[..., GuardedServer], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        tunnels: list[str] = []
        monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda *_, **__: tunnels.append("opened"))
        monkeypatch.setattr(GuardedServer, "request_share_url", lambda *_, **__: tunnels.append("opened"))
        server = serve()
        own: list[Any] = []
        shared = server.gui.add_text("shared", "old")

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            own.append(client.gui.add_text("own", "old"))

        with open_websocket(server) as websocket:

            def send(**message: Any) -> None:
                websocket.send(msgspec.msgpack.encode(message))

            send(**CAMERA)
            wait_for(lambda: own)
            for widget in (shared, own[0]):
                uuid = widget._impl.uuid
                send(type="GuiUpdateMessage", uuid=uuid, updates={"update_cb": ["x"]})
                send(type="GuiUpdateMessage", uuid=uuid, updates={"value": "bad", "is_button": True})
                send(
                    type="GuiUpdateMessage", uuid=uuid, updates={"value": "x" * (message_guard.MAX_TEXT + 1)}
                )
                send(type="GuiUpdateMessage", uuid=uuid, updates={"value": {"a": 1}})
                send(type="GuiUpdateMessage", uuid=uuid, updates={"value": float("nan")})
                send(type="ShareUrlRequest")
                send(type="ShareUrlDisconnect")
                send(
                    type="FileTransferStartUpload",
                    source_component_uuid=uuid,
                    transfer_uuid="t",
                    filename="f",
                    mime_type="m",
                    part_count=1,
                    size_bytes=1,
                )
            # The last of these messages to arrive, so everything before it was dealt with.
            send(type="GuiUpdateMessage", uuid=own[0]._impl.uuid, updates={"value": "new"})
            wait_for(lambda: own[0].value == "new")
            assert shared.value == "old"
            for widget in (shared, own[0]):
                assert widget._impl.update_cb == [] and not widget._impl.is_button
            assert tunnels == [] and server._share_tunnel is None

    def test_a_public_tunnel_cannot_be_asked_for_in_code(self, serve: Callable[..., GuardedServer]) -> None:
        with pytest.raises(OasisError, match="no public tunnel"):
            serve().request_share_url()

    @pytest.mark.parametrize(
        ("value", "plain"),
        [
            (True, True),
            (None, True),
            (0.5, True),
            (["a", [1, 2]], True),
            (float("inf"), False),
            (2**60, False),
            ([0] * 300, False),
            ([[[[[]]]]], False),
            (b"bytes", False),
            ({}, False),
        ],
    )
    def test_plain_values(self, value: Any, plain: bool) -> None:
        assert message_guard.is_plain_value(value) is plain


class TestStart:
    def test_a_taken_port_is_an_error_and_never_another_port(
        self, serve: Callable[..., GuardedServer], capfd: pytest.CaptureFixture[str]
    ) -> None:
        port = serve().get_port()
        with pytest.raises(InputError) as refused:
            GuardedServer(port=port)
        assert str(refused.value) == (
            f"port {port} on 127.0.0.1 is already in use: close the other program or choose another --port"
        )
        assert "\n" not in str(refused.value)

    @pytest.mark.parametrize("host", ["no.such.host.invalid", "203.0.113.7", "not a host", "a" * 300])
    def test_hosts_that_are_not_ours(self, host: str) -> None:
        with pytest.raises(InputError, match=r"use 127\.0\.0\.1, or an address of this machine"):
            GuardedServer(port=0, host=host)

    @pytest.mark.parametrize("port", [-1, 65536])
    def test_ports_that_do_not_exist(self, port: int) -> None:
        with pytest.raises(InputError, match="does not exist"):
            GuardedServer(port=port)

    def test_nothing_is_printed(self, capfd: pytest.CaptureFixture[str]) -> None:
        GuardedServer(port=0).stop()
        printed = capfd.readouterr()
        assert (printed.out, printed.err) == ("", "")

    def test_ipv6(self) -> None:
        try:
            server = GuardedServer(port=0, host="::1")
        except InputError:
            pytest.skip("no IPv6 on this machine")
        try:
            assert server.token is None
            assert server.url == f"http://[::1]:{server.get_port()}/"
        finally:
            server.stop()

    @pytest.mark.parametrize("token", [None, TOKEN])
    @pytest.mark.parametrize("hook", ["messages", "requests", "hosts", "origins", "cookies"])
    def test_refuses_to_serve_when_a_guard_is_not_in_force(
        self, hook: str, token: str | None, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        if hook == "messages":
            stock = message_guard._stock_handle
            monkeypatch.setattr(message_guard, "install", lambda: None)
            monkeypatch.setattr(_infra.WebsockMessageHandler, "_handle_incoming_message", stock)
        elif hook == "requests":
            monkeypatch.setattr(RequestGuard, "wrap", lambda self, serve_page: serve_page)
        elif hook == "hosts":
            monkeypatch.setattr(RequestGuard, "is_known_host", lambda self, host: True)
        elif hook == "origins":
            if token is not None:
                pytest.skip("a stranger never gets as far as the origin")
            monkeypatch.setattr(request_guard, "is_same_origin", lambda origin, host: True)
        else:
            if token is None:
                pytest.skip("nobody logs in")
            monkeypatch.setattr(RequestGuard, "name_in", lambda self, headers: "anybody")
        with socket.create_server(("127.0.0.1", 0)) as probe:
            port = probe.getsockname()[1]
        with pytest.raises(OasisError, match="not in force"):
            GuardedServer(port=port, token=token)
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port), timeout=5)
