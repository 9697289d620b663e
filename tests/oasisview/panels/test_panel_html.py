from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from oasisview import wording
from oasisview.assets import AssetTable
from oasisview.catalogue import Catalogue
from oasisview.decisions import Verdict
from oasisview.job import JobState
from oasisview.panels import queue
from oasisview.panels.band import band_html
from oasisview.panels.candidates import candidates
from oasisview.panels.evidence import evidence_html
from oasisview.panels.export import DOWNLOADS, export_html
from oasisview.panels.hud import COLOURS, Layers, hud_html, legend_html, who_html
from oasisview.panels.journal import journal_html
from oasisview.panels.matrix import cell_at, matrix_html
from oasisview.panels.progress import progress_html
from oasisview.queue_filter import QueueFilter, next_to_review, queue_order, step
from oasisview.review import Event, Kind, MachineMap
from pipeline.progress import STAGES, ProgressEvent
from pipeline.result import ChangeLabel, MatchCase, Result

NASTY = "<script>alert('x')</script>\"&"
VOID = {"img", "input", "br"}


class Balance(HTMLParser):
    """Fails on tags that are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attributes: list) -> None:
        names = [name for name, _ in attributes]
        assert len(names) == len(set(names)), f"<{tag}> has an attribute twice: {names}"
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attributes: list) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"


def checked(html: str) -> str:
    parser = Balance()
    parser.feed(html)
    parser.close()
    assert parser.open == []
    assert "<script" not in html.lower() and "None" not in re.sub(r"None was chosen|None of its", "", html)
    return html


@pytest.fixture
def assets() -> AssetTable:
    return AssetTable()


@pytest.fixture
def catalogue(small_result: Result, assets: AssetTable) -> Catalogue:
    return Catalogue(small_result, assets)


def verdict(label: ChangeLabel, *, accepted: bool = False, reason: str = "") -> Verdict:
    return Verdict(label, accepted, "ann", "2026-03-10T08:00:00.000+00:00", reason)


def test_the_queue_lists_changes_by_doubt_and_keeps_what_was_decided(catalogue: Catalogue) -> None:
    shown = QueueFilter()
    order = [item.object_id for item in queue_order(catalogue.by_doubt(), {}, shown)]
    assert set(order) == {4, 5, 6, 7, 8, 9, 10, 11, 12}
    assert set(order[:2]) == {10, 11}
    doubts = [catalogue.doubt(catalogue.objects[i]) for i in order[2:]]
    assert doubts == sorted(doubts, reverse=True)
    decided = {10: verdict(ChangeLabel.STATIC), 1: verdict(ChangeLabel.STATIC, accepted=True)}
    later = [item.object_id for item in queue_order(catalogue.by_doubt(), decided, shown)]
    assert set(later) == set(order) | {1} and set(later[-2:]) == {10, 1}


def test_queue_counts_filters_and_verdicts_are_shown(catalogue: Catalogue) -> None:
    decided = {12: verdict(ChangeLabel.STATIC), 6: verdict(ChangeLabel.APPEARED, accepted=True)}
    html = checked(queue.queue_html(catalogue, decided, QueueFilter()))
    assert "2 of 9 decided" in html and "1 corrected" in html
    assert re.search(r'aria-pressed="false"[^>]*aria-label="static: 3"', html)
    assert html.count('class="oa-row') == 9 and html.count("oa-row oa-done") == 2
    nothing = checked(queue.queue_html(catalogue, {}, QueueFilter(frozenset())))
    assert wording.NOTHING_IN_QUEUE in nothing
    everything = {i: verdict(item.label, accepted=True) for i, item in catalogue.objects.items()}
    assert "All 12 decided" in queue.queue_html(catalogue, everything, QueueFilter())


def test_stepping_goes_around_and_on_to_what_is_undecided(catalogue: Catalogue) -> None:
    order = queue_order(catalogue.by_doubt(), {}, QueueFilter())
    ids = [item.object_id for item in order]
    assert step(order, None, 1) == ids[0] and step(order, None, -1) == ids[-1]
    assert step(order, ids[-1], 1) == ids[0] and step(order, ids[0], -1) == ids[-1]
    assert step([], 3, 1) is None
    decided = {i: verdict(ChangeLabel.STATIC) for i in ids[:3]}
    assert next_to_review(order, decided, None) == ids[3]
    assert next_to_review(order, decided, ids[-1]) == ids[3]
    assert next_to_review(order, dict.fromkeys(ids, decided[ids[0]]), None) is None


@pytest.mark.parametrize("swipe", [False, True])
def test_evidence_of_every_object_is_whole(catalogue: Catalogue, swipe: bool) -> None:
    for object_id, item in catalogue.objects.items():
        html = checked(evidence_html(catalogue, object_id, None, swipe=swipe))
        assert wording.CASE_WORDS[item.case] in html and f"{item.coverage:.0%}" in html
        assert html.count("data-accept") == 1 and html.count('data-send="decide"') == 5


def test_evidence_shows_partner_rivals_links_and_place(catalogue: Catalogue) -> None:
    moved = evidence_html(catalogue, 4, None)
    assert "oa-chosen" in moved and 'class="oa-link"' in moved and "82 cm" in moved
    gone = evidence_html(catalogue, 8, None)
    assert "oa-place" in gone and "replaced by" in gone and "None was chosen" in gone
    assert "70% of the patches land here, but they match poorly (0.55, at least 0.85 needed)" in gone
    assert "No keyframe" not in gone


def test_what_people_wrote_is_escaped(catalogue: Catalogue) -> None:
    said = replace(verdict(ChangeLabel.STATIC, reason=NASTY), who=NASTY)
    html = checked(evidence_html(catalogue, 12, said, conflict=NASTY))
    assert html.count("&lt;script&gt;") == 4
    event = Event(1, "2026-03-10T08:00:00.000+00:00", NASTY, Kind.LABEL, 12, ChangeLabel.APPEARED,
                  ChangeLabel.STATIC, NASTY, None)  # fmt: skip
    checked(journal_html([event], MachineMap.of_labels({})))
    checked(export_html(1, 3, NASTY))
    checked(who_html(NASTY, [(NASTY, None), (NASTY, 12)], NASTY))
    checked(progress_html(JobState(warnings=(NASTY,), error=NASTY), [NASTY], 3.0))


def test_candidates_are_the_own_row_or_column_best_first(catalogue: Catalogue) -> None:
    matrix = catalogue.result.score_matrix
    for item in catalogue.objects.values():
        found = candidates(catalogue, item)
        values = [c.sigma for c in found if not c.chosen]
        assert values == sorted(values, reverse=True)
        assert [c.chosen for c in found].count(True) == (1 if len(item.sightings) == 2 else 0)
    appeared = catalogue.objects[7]
    column = appeared.sighting(1).instance
    best = candidates(catalogue, appeared)[0]
    assert best.sigma == pytest.approx(float(matrix.sigma_backward[:, column].max()))
    assert best.object_id == 8


def test_the_band_names_both_keyframes_and_outlines_the_selection(catalogue: Catalogue) -> None:
    label_of = lambda i: catalogue.objects[i].label  # noqa: E731
    html = checked(band_html(catalogue, 1, 0, 4, label_of, dark=False))
    pair = catalogue.covisible(1, 0)
    assert f"kf {pair.other_keyframe + 1}" in html and f"{pair.shared:.0%} shared" in html
    assert html.count("oa-line oa-moved") >= 3
    parts = re.findall(r'data-part="([a-z]+)"', html)
    for k in range(6):
        other = checked(band_html(catalogue, 0, k, None, label_of, dark=True))
        assert re.findall(r'data-part="([a-z]+)"', other) == parts


def test_a_keyframe_without_counterpart_says_so(catalogue: Catalogue, monkeypatch) -> None:
    monkeypatch.setattr(catalogue, "covisible", lambda session, keyframe: None)
    html = checked(band_html(catalogue, 1, 2, 4, lambda i: catalogue.objects[i].label, dark=False))
    assert html.count(wording.NO_SHARED_VIEW) == 3 and html.count("<img") == 1


def test_every_picture_named_by_the_panels_can_be_fetched(catalogue: Catalogue, assets: AssetTable) -> None:
    html = queue.queue_html(catalogue, {}, QueueFilter(frozenset(ChangeLabel)))
    html += "".join(evidence_html(catalogue, i, None) for i in catalogue.objects)
    html += band_html(catalogue, 1, 3, 4, lambda i: catalogue.objects[i].label, dark=True)
    html += matrix_html(catalogue, "sigma", None, (0, 0)) + matrix_html(catalogue, "s_bar", 4, None)
    urls = set(re.findall(r'src="(/asset/[^"]+)"', html))
    assert len(urls) > 20
    for url in urls:
        asset = assets.get(url.removeprefix("/asset/"))
        assert asset is not None and asset.data[:2] in (b"\xff\xd8", b"\x89P"), url


def test_matrix_cells_and_cases(catalogue: Catalogue) -> None:
    assert cell_at((8, 9), 0.0, 0.0) == (0, 0) and cell_at((8, 9), 1.0, 1.0) == (7, 8)
    assert cell_at((8, 9), 0.5, 0.3) == (2, 4) and cell_at((0, 9), 0.5, 0.5) is None
    limits = wording.Limits(0.3, 0.85, 0.1, 0.5)
    pairs = ((0.4, 0.9), (0.1, 0.9), (0.4, 0.5), (0.1, 0.5))
    assert [wording.pair_case(sigma, s_bar, limits) for sigma, s_bar in pairs] == list(MatchCase)
    html = checked(matrix_html(catalogue, "sigma", 4, (0, 0)))
    assert html.count("oa-partner") == 5 and html.count('"oa-own"') == 2 and 'data-pair="1-1"' in html


def test_the_matrix_can_be_read_close_up(catalogue: Catalogue) -> None:
    matrix = catalogue.result.score_matrix
    row, column = matrix.row_object_ids.tolist().index(8), matrix.column_object_ids.tolist().index(7)
    html = checked(matrix_html(catalogue, "s_bar", None, (row, column)))
    tips = re.findall(r'<button class="oa-cell[^>]* title="([^"]*)"', html)
    assert len(tips) == html.count('data-send="matrix_cell"') > 4
    (own,) = [tip for tip in tips if tip.startswith("#8 before, #7 after")]
    assert "case 3: looks alike" in own and f"{matrix.s_bar[row, column]:.2f}" in own
    assert len(re.findall(r'aria-pressed="true" [^>]*title="#8 before, #7 after', html)) == 1


def test_hud_layers_and_legend() -> None:
    html = checked(hud_html("both", "label", Layers(path=True), dark=True))
    assert re.search(r'aria-pressed="true" data-send="mode" data-value="&quot;both&quot;"', html)
    assert re.search(r'checked data-send="layer" data-key="path"', html)
    assert not Layers(boxes=True).switched("boxes", on=False).boxes
    with pytest.raises(ValueError, match="no layer"):
        Layers().switched("__class__", on=True)
    for colours in COLOURS:
        checked(legend_html(colours, "both"))


def test_journal_strikes_out_what_was_undone() -> None:
    at = "2026-03-10T08:00:00.000+00:00"
    label = Event(1, at, "ann", Kind.LABEL, 12, ChangeLabel.APPEARED, ChangeLabel.STATIC, "", None)
    undo = Event(2, at, "ann", Kind.UNDO, 12, ChangeLabel.STATIC, ChangeLabel.APPEARED, "", 1)
    redo = Event(3, at, "ann", Kind.REDO, 12, ChangeLabel.APPEARED, ChangeLabel.STATIC, "", 1)
    machine = MachineMap.of_labels({12: ChangeLabel.APPEARED})
    assert "oa-undone" not in checked(journal_html([label], machine))
    assert checked(journal_html([label, undo], machine, {1})).count("oa-undone") == 1
    assert "oa-undone" not in journal_html([label, undo, redo], machine)
    assert wording.NO_DECISIONS in journal_html([], machine)


def test_progress_marks_stages_before_at_and_after_the_present_one() -> None:
    state = JobState(
        progress={"open": ProgressEvent("open", 2, 2), "objects": ProgressEvent("objects", 1, 4)}
    )
    html = checked(progress_html(state, ["a", "b"], 65))
    assert html.count("oa-stage-done") == 5 and html.count("oa-stage-now") == 1
    assert html.count("oa-stage-later") == len(STAGES) - 6
    assert "1 of 4" in html and "1 min 05 s" in html and "width:25%" in html
    assert "data-send" not in progress_html(JobState(error="no disk"), [], 1)


def test_export_offers_every_format_of_the_page() -> None:
    html = checked(export_html(2, 9, ""))
    assert re.findall(r'data-format="(\w+)"', html) == [d.format for d in DOWNLOADS]
    assert "other 7 go out with the machine" in html


def test_sizes_and_doubt_are_finite(catalogue: Catalogue) -> None:
    assert np.isfinite([catalogue.doubt(item) for item in catalogue.objects.values()]).all()
