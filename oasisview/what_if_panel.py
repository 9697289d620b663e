"""The what-if tab as viser holds it: controls, rarely sent, and the outcome, which follows every step."""

from __future__ import annotations

import viser


class WhatIfPanel:
    """Two pieces of html in a tab, one below the other.

    Args:
        gui: of the client; tab: where the pieces go.
    """

    def __init__(self, gui: viser.GuiApi, tab: viser.GuiTabHandle) -> None:
        self._gui = gui
        self._tab = tab
        with tab:
            self._controls = gui.add_html("", order=0)
            self._outcome = gui.add_html("", order=1)

    def show(self, controls: str, outcome: str) -> None:
        """Both pieces."""
        self.show_controls(controls)
        self.show_outcome(outcome)

    def show_controls(self, content: str) -> None:
        """The sliders anew: whatever hand is on them loses its grip."""
        # A piece whose content changes keeps the inputs in it, and sliders would stay where they were.
        self._controls.remove()
        with self._tab:
            self._controls = self._gui.add_html(content, order=0)

    def show_outcome(self, content: str) -> None:
        """What would be otherwise."""
        self._outcome.content = content
