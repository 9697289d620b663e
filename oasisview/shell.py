"""The page around viser's panels, for one browser tab.

HTML given to the shell is trusted: pass everything that comes from files or people through ``escape``.
Inside it (and inside viser's ``add_html``) elements talk to the server without any script of their own:

- ``data-send="KIND" data-value="JSON"``: a click (or Enter when focused) sends the event.
- ``<input data-send="KIND">``: every input sends its value (range and number: as a number, checkbox: as
  a boolean), at most one every 40 ms, the last one always. With ``data-key="NAME"`` it sends
  ``{"key": NAME, "value": value}``.
- ``data-pixel="KIND" data-session="1" data-keyframe="12"`` on an element around one ``<img>``: a click
  sends a ``PixelClick`` (object-fit: contain is accounted for).
- ``data-accept``: the button that the Enter key presses. ``data-open="note"`` / ``data-open="help"``
  opens the dialog. Scripts may call ``O(kind, value)`` themselves.

Styles: ``web_assets/style.css`` is sent first, then every other ``web_assets/*.css`` by name. Root elements
carry class ``oa``; ``oa-static``, ``oa-appeared`` ... set the colour ``--c``; all colours are variables
``--oa-...`` of style.css.

Viser has no public way to run a script in a page: ``Shell.available`` says whether the private one is
there. Without it regions stay empty, and panels, commands and notifications carry on alone.
"""

from __future__ import annotations

import dataclasses
import html
import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, Literal, TypeVar, get_args

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray
from viser import _messages

from oasisview import events
from oasisview.access import GuardedServer
from oasisview.event_queue import EventQueue, Handler

T = TypeVar("T")
Region = Literal["band", "hud", "preview", "legend", "who", "page"]

ACCENT_LIGHT = (36, 86, 200)
ACCENT_DARK = (125, 167, 255)  # the light one is unreadable on the dark ground

SHELL_KEYS = (
    ("Enter", "accept the machine's label"),
    ("X", "swipe between before and after"),
    ("H", "see the whole site"),
    ("M", "write a note"),
    ("/", "find an object by its number"),
    (".", "skip: decide on this object later"),
    ("?", "these keys"),
    ("L", "copy a link to what is shown"),
    ("Esc", "close; one step back while measuring"),
    ("W A S D Q E, arrows", "move the camera"),
    ("Ctrl+K", "find a command by its name"),
)
# Run in this order after shell.js; each extends window.oasis.
SCRIPTS = ("dialogs.js", "grid.js", "links.js", "review.js", "sharing.js", "swipe.js")
# What a shell key sends, as commands of viser for pages that cannot be extended.
FALLBACK_COMMANDS = {"swipe": ("Swipe before / after", "X"), "overview": ("See the whole site", "H")}


def escape(value: object) -> str:
    """Text for HTML content or a quoted attribute; everything not written by us goes through this."""
    return html.escape(str(value), quote=True)


@cache
def _stylesheet() -> str:
    sheets = {
        entry.name: entry for entry in resources.files("web_assets").iterdir() if entry.name.endswith(".css")
    }
    first = sheets.pop("style.css")
    return "\n".join(
        sheet.read_text("utf-8") for sheet in (first, *(sheets[name] for name in sorted(sheets)))
    )


@cache
def _script(name: str) -> str:
    return resources.files("web_assets").joinpath(name).read_text("utf-8").strip()


class Shell:
    """Regions, events, camera flights and dialogs of one tab; make one per connected client.

    It owns a hidden text widget: ``client.gui.reset()`` would cut its events off.

    Events that the page sends by itself, once a handler is registered for them: ``hello`` (parsed by
    ``events.hello``), ``note`` (``events.text()``), ``undo``, ``swipe`` and ``overview`` (no value).

    Args:
        client: the tab. The theme is set for it at once.
        server: where the tab is connected.
        dark: dark or light theme to begin with.
    """

    def __init__(self, client: viser.ClientHandle, server: GuardedServer, *, dark: bool = False) -> None:
        self.client = client
        self.user = server.user_of_client(client.client_id)
        self._queue = EventQueue(report=self.toast)
        self._extended = self.available()
        self.set_theme(dark)
        if not self._extended:
            return
        bridge = client.gui.add_text("oasisview", "", visible=False)

        @bridge.on_update
        async def _(event: Any) -> None:
            self._queue.receive(event.target.value)

        options = {
            "bridge": bridge._impl.uuid,
            "css": _stylesheet(),
            "keys": SHELL_KEYS,
            "regions": get_args(Region),
            "maxText": events.MAX_TEXT_LENGTH,
        }
        first = f"({_script('shell.js')})({json.dumps(options)})"
        self._run(";".join([first, *(f"({_script(name)})()" for name in SCRIPTS)]))

    @staticmethod
    def available() -> bool:
        """Whether this viser lets a page be extended; if not, only panels work and regions stay empty."""
        message = getattr(_messages, "RunJavascriptMessage", None)
        return (
            message is not None
            and dataclasses.is_dataclass(message)
            and [field.name for field in dataclasses.fields(message) if field.init] == ["source"]
        )

    def set_html(self, region: Region, content: str) -> None:
        """Replace the content of a region of the page; an empty band gives its space back to the 3D view."""
        self._call("setHtml", region, content)

    def swap_band(self, content: str) -> None:
        """Replace the band without flicker: its images are decoded first, inputs in use stay untouched.

        Elements that change carry ``data-part="NAME"``, the same names each time and none inside another;
        if the names differ from what is shown, the whole band is replaced. Late answers never overwrite
        newer ones.
        """
        self._call("swapBand", content)

    def toast(self, message: str, *, undo: bool = False) -> None:
        """A short plain-text message at the foot of the map; ``undo`` adds a button that sends ``undo``."""
        if self._extended:
            self._call("toast", message, undo)
        else:
            self.client.add_notification("", message, auto_close_seconds=8.0 if undo else 4.0)

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
        self._queue.register(kind, handler, parse, latest_only=latest_only)
        if not self._extended and kind in FALLBACK_COMMANDS:
            label, hotkey = FALLBACK_COMMANDS[kind]
            self.add_command(label, hotkey, lambda: handler(None))  # type: ignore[arg-type]

    def add_command(self, label: str, hotkey: str | None, handler: Callable[[], Any]) -> None:
        """A keyboard command of this tab, also in viser's palette (ctrl+K).

        Handled in order with the events, by the same rules. W A S D Q E and the arrows belong to the
        camera, and Enter, X, H, M, L and ? to the shell.
        """
        command = self.client.gui.add_command(label, hotkey=hotkey)  # type: ignore[arg-type]

        @command.on_trigger
        async def _(_: Any) -> None:
            self._queue.put(f"command {label}", lambda _: handler(), None)

        if hotkey is not None:
            self._call("addKey", hotkey.upper() if len(hotkey) == 1 else hotkey, label)

    def fly_to(self, position: ArrayLike, look_at: ArrayLike) -> None:
        """Move the camera smoothly; (3,) world metres each. Jumps where the page cannot be extended.

        Raises:
            ValueError: a place is not three finite numbers, or the two are the same.
        """
        eye, target = _place(position), _place(look_at)
        if np.linalg.norm(eye - target) < 1e-6:
            raise ValueError("the camera cannot look at the place where it is")
        if self._extended:
            self._call("flyTo", eye.tolist(), target.tolist())
        else:
            with self.client.atomic():
                self.client.camera.position = eye
                self.client.camera.look_at = target

    def set_selection(self, object_id: int | None) -> None:
        """Mark ``[data-object="ID"]`` elements as selected, scroll to the row, keep it in the address."""
        self._call("setSelection", None if object_id is None else int(object_id))

    def set_address(self, **values: str | None) -> None:
        """Keep places in the page's address, to be found again after a reload; None removes one."""
        self._call("setAddress", values)

    def remember(self, tastes: Mapping[str, Any]) -> None:
        """Keep what a person likes in the browser; later pages send it with their ``hello``."""
        self._call("remember", dict(tastes))

    def set_theme(self, dark: bool) -> None:
        """Light or dark, for the panels of viser and for everything of the shell."""
        self.client.gui.configure_theme(
            dark_mode=dark,
            show_logo=False,
            show_share_button=False,
            brand_color=ACCENT_DARK if dark else ACCENT_LIGHT,
        )

    def ask_reason(self, title: str, hint: str) -> None:
        """Open a dialog that sends ``reason`` (text) or, only if chosen explicitly, ``no_reason``."""
        self._call("askReason", title, hint)

    def ask_text(self, title: str, hint: str, text: str, kind: str) -> None:
        """Open a dialog with a text to be changed or left as it is, and send it as an event of that kind."""
        self._call("askText", title, hint, text, kind)

    def confirm(self, title: str, text: str, buttons: Mapping[str, str]) -> None:
        """Open a dialog that says what will happen, with room for a reason.

        It sends ``confirmed``, ``{"choice": a key of buttons, "reason": text}``; the last button is the main
        one. Closing it sends nothing.
        """
        self._call("confirm", title, text, list(buttons.items()))

    def set_cursors(self, others: Sequence[tuple[str, int]]) -> None:
        """Mark the rows of ``[data-object="ID"]`` that other people look at with their initials."""
        self._call("setCursors", [list(other) for other in others])

    def set_picking(self, text: str) -> None:
        """Show what to click next until the text is empty again; Esc sends ``end_pick``."""
        self._call("setPicking", text)

    def close(self) -> None:
        """Stop handling events; call when the client disconnects."""
        self._queue.close()

    def _call(self, function: str, *arguments: Any) -> None:
        if self._extended:
            self._run(f"window.oasis.{function}({', '.join(map(json.dumps, arguments))})")

    def _run(self, source: str) -> None:
        # An exception in the script would end viser's handling of the whole batch of messages.
        script = f"try{{{source}}}catch(error){{console.error('oasisview',error)}}"
        # To this client alone: for the server's scope viser would keep every script for all who come later.
        self.client.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(source=script))


def _place(point: ArrayLike) -> NDArray[np.float64]:
    place = np.asarray(point, dtype=np.float64)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise ValueError(f"three finite numbers expected, got {point!r}")
    return place
