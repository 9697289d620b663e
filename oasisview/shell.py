"""The page around viser's panels, for one browser tab.

HTML given to the shell is trusted: pass everything that comes from files or people through ``escape``.
Inside it (and inside viser's ``add_html``) elements talk to the server without any script of their own:

- ``data-send="KIND" data-value="JSON"``: a click (or Enter when focused) sends the event.
- ``<input data-send="KIND">``: every input sends its value (range and number: as a number, checkbox: as
  a boolean), at most one every 40 ms, the last one always.
- ``data-pixel="KIND" data-session="1" data-keyframe="12"`` on an element around one ``<img>``: a click
  sends a ``PixelClick`` (object-fit: contain is accounted for).
- ``data-accept``: the button that the Enter key presses. ``data-open="note"`` / ``data-open="help"``
  opens the dialog. Scripts may call ``O(kind, value)`` themselves.

Styles: ``web_assets/style.css`` is sent first, then every other ``web_assets/*.css`` by name. Root elements
carry class ``oa``; ``oa-static``, ``oa-appeared`` ... set the colour ``--c``; all colours are variables
``--oa-...`` of style.css.
"""

from __future__ import annotations

import html
from collections.abc import Awaitable, Callable
from typing import Any, Literal, TypeVar

import numpy as np
import viser
from numpy.typing import ArrayLike

from oasisview import events
from oasisview.access import GuardedServer

T = TypeVar("T")
Region = Literal["band", "hud", "legend", "who"]
Handler = Callable[[T], Awaitable[None] | None]


def escape(value: object) -> str:
    """Text for HTML content or a quoted attribute; everything not written by us goes through this."""
    return html.escape(str(value), quote=True)


class Shell:
    """Regions, events, camera flights and dialogs of one tab; make one per connected client.

    Events that the shell itself sends, once a handler is registered for them: ``hello`` (``Hello``),
    ``note`` (text), ``undo``, ``swipe`` and ``overview`` (nothing).
    """

    def __init__(self, client: viser.ClientHandle, server: GuardedServer, *, dark: bool = False) -> None:
        self.client = client
        self.user = server.user_of_client(client.client_id)

    @staticmethod
    def available() -> bool:
        """Whether this viser lets a page be extended; if not, only panels work and regions stay empty."""
        return False

    def set_html(self, region: Region, content: str) -> None:
        """Replace the content of a region of the page; an empty band gives its space back to the 3D view."""

    def swap_band(self, content: str) -> None:
        """Replace the band without flicker: its images are decoded first, inputs in use stay untouched.

        Elements that change carry ``data-part="NAME"``, the same names each time; if the names differ
        from what is shown, the whole band is replaced. Late answers never overwrite newer ones.
        """

    def toast(self, message: str, *, undo: bool = False) -> None:
        """A short plain-text message at the foot of the map; ``undo`` adds a button that sends ``undo``."""

    def on_event(
        self,
        kind: str,
        handler: Handler[T],
        parse: events.Parser[T] = events.nothing,  # type: ignore[assignment]
        *,
        latest_only: bool = False,
    ) -> None:
        """Call ``handler`` with the parsed value of each event of a kind.

        Events of a tab are handled one after the other, in the order in which they were sent. A plain
        function runs on a worker thread, a coroutine function on the event loop. An exception in a
        handler is logged and shown as a toast. ``latest_only`` skips an event when a newer one of its kind
        waits already (sliders).
        """

    def add_command(self, label: str, hotkey: str | None, handler: Callable[[], Any]) -> None:
        """A keyboard command of this tab, also in viser's palette (ctrl+K); handled in order with events."""

    def fly_to(self, position: ArrayLike, look_at: ArrayLike) -> None:
        """Move the camera smoothly; (3,) world metres each. Jumps where the page cannot be extended."""
        self.client.camera.position = np.asarray(position, dtype=np.float64)
        self.client.camera.look_at = np.asarray(look_at, dtype=np.float64)

    def set_selection(self, object_id: int | None) -> None:
        """Mark ``[data-object="ID"]`` elements as selected, scroll to the row, keep it in the address."""

    def set_theme(self, dark: bool) -> None:
        """Light or dark, for the panels of viser and for everything of the shell."""

    def ask_reason(self, title: str, kind: str, *, value: str = "") -> None:
        """Open a dialog with a text field; saving sends the text as an event of ``kind``."""

    def close(self) -> None:
        """Stop handling events; call when the client disconnects."""
