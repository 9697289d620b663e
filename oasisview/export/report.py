"""``report``: one HTML page that needs nothing else, for reading, printing and filing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path

from oasisview.export import report_method, report_words
from oasisview.export.exporter import ReviewedResult, Steps, chunk_count
from oasisview.export.footprints import footprints
from oasisview.export.report_cards import ReportCards, unchanged
from oasisview.export.report_marks import DEFINITIONS, standalone
from oasisview.export.report_plan import plan_svg
from oasisview.export.report_words import SECTIONS, Change, numbered_changes, visit_name
from oasisview.scene.ground_plan import GroundPlan
from oasisview.shell import escape
from pipeline.progress import Report, silent
from pipeline.result import ChangeLabel
from pipeline.store.files import atomic_file

_COLUMNS = ("no.", "what", "object", "size", "moved by", "confidence<br>of the machine", "checked by")
_LEGEND = {
    "moved": "moved: dashed outline where it was, arrow to where it is",
    "appeared": "appeared (new)",
    "disappeared": "disappeared (gone): hatched outline",
    "unknown": "unknown (not decided): dotted outline",
    "replaced": "replaced: a purple band around what is gone and what stands there now",
    "static": "static (not changed): not drawn",
}


class ReportExporter:
    """Summary, plan, each change with pictures and evidence, decisions, settings; A4 when printed."""

    name = "report"
    suffix = ".html"
    summary = "one HTML page to read or print: plan, pictures and evidence of every change"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the page, entry by entry; see ``Exporter.write``."""
        changes = numbered_changes(reviewed)
        steps = Steps(report, chunk_count(reviewed) + len(changes) + 1)
        with atomic_file(out_path) as file:
            for part in _page(reviewed, changes, steps):
                file.write(part.encode())


def _page(reviewed: ReviewedResult, changes: Sequence[Change], steps: Steps) -> Iterator[str]:
    result = reviewed.result
    title = f"What changed: {result.path.stem}"
    style = resources.files("oasisview.export").joinpath("report.css").read_text("utf-8")
    before, after = result.sessions[0], result.sessions[-1]
    yield (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body>{DEFINITIONS}<main><header><h1>{escape(title)}</h1>"
        f'<p class="visits"><b>Before</b> {escape(visit_name(before))}<br>'
        f'<b>After</b> {escape(visit_name(after))}</p></header>\n<section class="summary">'
    )
    yield "".join(f"<p>{escape(sentence)}</p>" for sentence in report_words.summary(reviewed) if sentence)
    yield "</section>\n"
    plan = GroundPlan.of(result)
    ground = footprints(reviewed, plan, steps)
    yield (
        '<section class="sheet"><h2>The place from above</h2>'
        f"{plan_svg(reviewed, changes, plan, ground)}{_legend(plan)}</section>\n"
    )
    steps.step()
    cards = ReportCards(reviewed, list(changes))
    if changes:
        head = "".join(f"<th>{name}</th>" for name in _COLUMNS)
        yield (
            f'<section><h2>All changes</h2><table class="list index"><thead><tr>{head}</tr></thead>'
            f"<tbody>{''.join(cards.row(change) for change in changes)}</tbody></table></section>\n"
        )
    for label, heading, meaning in SECTIONS:
        listed = [change for change in changes if change.label is label]
        if listed:
            yield (
                f'<section><div class="opening"><h2>{standalone(_name(label))}{heading} '
                f'<span class="soft">{len(listed)}</span></h2><p class="small">{meaning}</p></div>\n'
            )
        for change in listed:
            yield cards.card(change)
            steps.step()
        if listed:
            yield "</section>\n"
    yield unchanged(reviewed)
    yield report_method.decisions(reviewed)
    yield report_method.method(reviewed)
    yield (
        f"<footer>Written by oasisview on {escape(report_words.now())}. Confidence is the machine's own "
        "estimate of the chance that its label is right. Lengths and positions are in metres of the world "
        "frame that both recordings share.</footer></main></body></html>\n"
    )


def _legend(plan: GroundPlan) -> str:
    items = "".join(f"<li>{standalone(name)}{escape(words)}</li>" for name, words in _LEGEND.items())
    seen = f"Seen along the direction of gravity, {plan.names[0]} to the right, {plan.names[1]} up the page."
    return (
        f'<ul class="legend">{items}</ul><p class="small soft">{escape(seen)} The picture shows the later '
        "visit without its ceiling, white where nothing was seen. Numbers are those of the entries below.</p>"
    )


def _name(label: ChangeLabel) -> str:
    return label.name.lower()
