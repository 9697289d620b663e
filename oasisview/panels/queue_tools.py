"""Search and filters over the queue: sent once, so that what a person types or chooses stays as it is."""

from __future__ import annotations

from collections.abc import Mapping

from oasisview.panels.markup import key
from oasisview.queue_filter import DECIDED, SIZES, VISITS, QueueFilter
from oasisview.shell import escape


def queue_tools_html(chosen: QueueFilter) -> str:
    """A field for numbers, and the filters behind a fold."""
    sizes = {name: words for name, (words, _, _) in SIZES.items()}
    checked = "checked" if chosen.disagreement else ""
    return (
        '<div class="oa oa-queue-tools"><div class="oa-find">'
        f'<input type="search" data-search data-send="search" data-enter="search_open" maxlength="12" '
        f'value="{escape(chosen.search)}" placeholder="Object number" '
        f'aria-label="Find an object by its number" title="Find an object by its number, then Enter (/)">'
        f"{key('/')}</div>"
        '<details class="oa-filters"><summary title="Which objects the queue lists">Filter</summary><div>'
        f"{_select('queue_decided', 'Decided', DECIDED, chosen.decided)}"
        f"{_select('queue_visit', 'Seen', VISITS, chosen.visit)}"
        f"{_select('queue_size', 'Size', sizes, chosen.size)}"
        '<label><span>Sure</span><span class="oa-range">'
        f"{_percent('queue_low', 'Least confidence, percent', chosen.low_percent)} to "
        f"{_percent('queue_high', 'Largest confidence, percent', chosen.high_percent)} %</span></label>"
        f'<label class="oa-check"><input type="checkbox" {checked} data-send="queue_disagreement">'
        "Inspectors disagree</label></div></details></div>"
    )


def _select(kind: str, name: str, choices: Mapping[str, str], chosen: str) -> str:
    options = "".join(
        f'<option value="{value}" {"selected" if value == chosen else ""}>{escape(words)}</option>'
        for value, words in choices.items()
    )
    return f'<label><span>{name}</span><select data-send="{kind}">{options}</select></label>'


def _percent(kind: str, tip: str, value: int) -> str:
    return (
        f'<input type="number" min="0" max="100" step="5" value="{value}" data-send="{kind}" '
        f'aria-label="{tip}" title="{tip}">'
    )
