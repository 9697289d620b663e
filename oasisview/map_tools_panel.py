"""The Map tab as viser holds it: three pieces, so that what changes in one leaves the others alone."""

from __future__ import annotations

import viser


class MapToolsPanel:
    """Measurements, cut and saved views, one below the other.

    Args:
        gui: of the client; tab: where the pieces go.
    """

    def __init__(self, gui: viser.GuiApi, tab: viser.GuiTabHandle) -> None:
        self._gui = gui
        self._tab = tab
        with tab:
            self._views = gui.add_html("", order=0)
            self._tape = gui.add_html("", order=1)
            self._cut = gui.add_html("", order=2)

    def show_tape(self, content: str) -> None:
        """The measured distances."""
        self._tape.content = content

    def show_cut(self, content: str) -> None:
        """The sliders anew: whatever hand is on them loses its grip."""
        # A piece whose content changes keeps the inputs in it, and sliders would stay where they were.
        self._cut.remove()
        with self._tab:
            self._cut = self._gui.add_html(content, order=2)

    def show_views(self, content: str) -> None:
        """The saved views."""
        self._views.content = content
