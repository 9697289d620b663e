"""What says that the map shows a preview, and ends it."""

from __future__ import annotations

from oasisview.panels.markup import sends
from oasisview.shell import escape


def preview_html(words: str) -> str:
    """The bar below the switches over the map."""
    return (
        f'<div class="oa oa-preview" role="status"><b>Preview</b> <span title="{escape(words)}">'
        f"{escape(words)}</span>"
        f'<button {sends("end_preview")} title="Show what has been decided again">End</button></div>'
    )
