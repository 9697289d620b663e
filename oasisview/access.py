"""Who may come in (stub of the API; the checks follow)."""

from __future__ import annotations

import getpass
from collections.abc import Sequence

import viser

from oasisview.assets import AssetSource


class GuardedServer(viser.ViserServer):
    """A viser server that decides who may load the page, open a websocket or fetch an asset.

    Args:
        host: address to listen on. Loopback demands no token; any other address does.
        port: TCP port; 0 picks a free one (``get_port()`` tells). Taken: ``InputError``, never another.
        token: what people log in with. None: none on loopback, a generated one elsewhere.
        assets: where ``/asset/<key>`` comes from; None: no assets.
        allowed_hosts: further names by which browsers may address the server.

    Raises:
        InputError: the port is taken, or the host is not an address of this machine.
        OasisError: the checks could not be put in force; nothing is served then.
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
        self.token = token
        super().__init__(host=host, port=port, label=label, verbose=False)

    @property
    def url(self) -> str:
        """Address of the page, without any secret."""
        return f"http://{self.get_host()}:{self.get_port()}/"

    @property
    def login_url(self) -> str:
        """Address to open in a browser; carries the token in its fragment where one is demanded."""
        return self.url

    def user_of_client(self, client_id: int) -> str:
        """Name of the person behind a client: from the login, else the system user on loopback."""
        return getpass.getuser()
