"""Reviewing in a real browser: corrections of identity, the queue's tools, the journal, several inspectors.

One page serves all tests; before each the journal is brought back to what the machine found, as an entry of
its own, and every test looks at the entries that it added.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from browser_harness import Tabs, ViewerPage, connected
from playwright.sync_api import Page, expect

from oasisview.app import RunningApp, start
from oasisview.inspector import Inspector
from oasisview.queue_filter import QueueFilter
from oasisview.review import Event, Kind, corrections
from pipeline.result import ChangeLabel

PATIENCE_MS = 40_000
# Software rendering costs by the pixel.
WINDOW = (1120, 700)


@pytest.fixture(scope="module")
def app(_small_result_template: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningApp]:
    copy = shutil.copytree(_small_result_template, tmp_path_factory.mktemp("review") / "small.oasis")
    running = start(copy, port=0)
    yield running
    running.stop()


@pytest.fixture(scope="module")
def _view_of_module(app: RunningApp, shared_tabs: Tabs) -> ViewerPage:
    view = connected(app.server, shared_tabs.open(app.login_url, WINDOW), set())
    view.page.wait_for_selector(".oa-row")
    view.page.wait_for_selector("#oa-band img")
    view.wait_node("/map/1/objects")
    return view


@pytest.fixture
def view(app: RunningApp, _view_of_module: ViewerPage, chromium_page: Callable[..., Page]) -> ViewerPage:
    """The page, on a map that nobody has decided anything about."""
    page, decisions = _view_of_module.page, app.workbench.decisions
    if page.locator("dialog[open]").count():
        page.keyboard.press("Escape")
    decisions.restore(0, who="reset", reason="", seen_event_id=None)
    page.get_by_role("tab", name="Queue").click()
    page.evaluate("() => { O('end_pick'); O('queue_all'); O('mode', 'after'); }")
    inspector = inspector_of(app)
    _view_of_module.wait_for(
        lambda: not decisions.verdicts and inspector.choices.queue == QueueFilter(), "the page to be as new"
    )
    inspector.choices.skipped = ()
    expect(page.locator("[data-role=reviewed]")).to_have_text("0 of 9 decided", timeout=PATIENCE_MS)
    return _view_of_module


@pytest.fixture
def added(app: RunningApp, view: ViewerPage) -> Callable[[], list[Event]]:
    """The entries of the journal since the test began."""
    before = app.workbench.decisions.last_event_id
    return lambda: list(app.workbench.decisions.history()[before:])


def inspector_of(app: RunningApp) -> Inspector:
    return app.inspectors()[0]


def select(view: ViewerPage, object_id: int) -> None:
    view.page.locator(f'.oa-row[data-object="{object_id}"]').click()
    view.page.wait_for_selector(f'[data-evidence="{object_id}"]')


def correct(view: ViewerPage, words: str) -> None:
    view.page.locator(".oa-correct summary").click()
    view.page.locator(".oa-menu button", has_text=words).click()


def toast(view: ViewerPage, text: str) -> None:
    expect(view.page.locator("#oa-toast")).to_contain_text(text, timeout=PATIENCE_MS)


def asked(view: ViewerPage) -> str:
    view.page.wait_for_selector("#oa-ask[open]")
    return view.page.locator("#oa-ask p").inner_text()


def listed(view: ViewerPage) -> set[int]:
    rows = view.page.locator(".oa-row").evaluate_all("rows => rows.map(row => Number(row.dataset.object))")
    return set(rows)


def wait_listed(view: ViewerPage, wanted: set[int]) -> None:
    view.wait_for(lambda: listed(view) == wanted, f"the queue to list {sorted(wanted)}")


CHANGED = {4, 5, 6, 7, 8, 9, 10, 11, 12}


def test_the_same_object_is_picked_in_the_queue_confirmed_undone_and_redone(app, view, added) -> None:
    page = view.page
    select(view, 8)
    correct(view, "Same as")
    expect(page.locator("#oa-picking")).to_contain_text("the same as object #8", timeout=PATIENCE_MS)
    page.locator('.oa-row[data-object="8"]').click()
    toast(view, "this object itself")
    page.locator('.oa-row[data-object="7"]').click()
    text = asked(view)
    assert "#7 now and #8 before become one object, #7: static, 5 cm from where it was" in text
    assert "#8 no longer counts as replaced by #7" in text
    expect(page.locator("#oa-picking")).to_be_hidden(timeout=PATIENCE_MS)
    assert added() == []
    page.locator("#oa-ask textarea").fill("the same chair <b>")
    page.keyboard.press("Control+Enter")
    toast(view, "Saved: #7 now and #8 before are the same object: static.")
    page.wait_for_selector('[data-evidence="7"]')
    (event,) = added()
    assert (event.kind, event.object_id, event.why) == (Kind.SAME, 8, "the same chair <b>")
    assert (event.old_label, event.new_label) == (ChangeLabel.DISAPPEARED, ChangeLabel.STATIC)
    why = page.locator('[data-evidence="7"] [data-role=why]')
    expect(why).to_contain_text("Corrected by", timeout=PATIENCE_MS)
    expect(why).to_contain_text("the same chair <b>")
    wait_listed(view, CHANGED - {8})
    expect(page.locator("[data-role=reviewed]")).to_have_text("1 of 8 decided")
    ids = app.workbench.points.visits[0].object_ids
    assert (ids == 7).any() and not (ids == 8).any()

    page.keyboard.press("u")
    toast(view, "Undone: #7 now and #8 before are the same object")
    wait_listed(view, CHANGED)
    page.keyboard.press("r")
    toast(view, "Redone: ")
    wait_listed(view, CHANGED - {8})
    assert [event.kind for event in added()] == [Kind.SAME, Kind.UNDO, Kind.REDO]
    page.reload()
    wait_listed(view, CHANGED - {8})
    page.wait_for_selector('[data-evidence="7"]')
    assert not page.problems


def test_the_other_object_can_be_picked_in_the_map_and_the_person_says_that_it_moved(
    app, view, added
) -> None:
    page = view.page
    select(view, 9)
    home = app.workbench.points.home.position
    page.evaluate("() => O('overview')")
    view.wait_for(lambda: np.allclose(view_client(app).camera.position, home, atol=0.02), "the whole site")
    correct(view, "Same as")
    page.wait_for_selector("#oa-picking:not([hidden])")
    points = app.workbench.points
    own = points.visits[1].objects[points.visits[1].object_ids == 12] + points.origin
    nearest = own[np.argmin(np.linalg.norm(own - np.array(home), axis=1))]
    seen = ViewerPage(page, view_client(app), view.server)
    seen.settle(5)
    seen.click_world(nearest)
    assert "#9 before and #12 now become one object, #9: moved, 2.72 m away" in asked(view)
    page.locator("#oa-ask button", has_text="It stayed").click()
    toast(view, "#9 before and #12 now are the same object: static")
    (event,) = added()
    assert event.groups[0].label is ChangeLabel.STATIC and event.new_label is ChangeLabel.STATIC
    assert app.workbench.decisions.label_of(9) is ChangeLabel.STATIC


def view_client(app: RunningApp):
    """The page's client: a reload makes a new one."""
    (client,) = app.server.get_clients().values()
    return client


def test_a_piece_is_picked_in_a_picture_merged_and_taken_apart_again(app, view, added) -> None:
    page = view.page
    select(view, 6)
    correct(view, "Merge with")
    page.wait_for_selector("#oa-picking:not([hidden])")
    choices = inspector_of(app).choices
    page.evaluate("k => O('keyframe', {session: 1, keyframe: k})", best_keyframe(app, 12))
    mask = app.workbench.catalogue.mask(1, best_keyframe(app, 12)) == 12
    rows, columns = np.nonzero(mask)
    middle = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    view.wait_for(lambda: choices.keyframe == best_keyframe(app, 12), "the keyframe")
    view.wait_js("k => document.querySelector('[data-part=this] .oa-pic')?.dataset.keyframe === String(k)",
                 best_keyframe(app, 12))  # fmt: skip
    view.settle(5)
    frame = page.locator('[data-part="this"] .oa-frame').bounding_box()
    page.mouse.click(
        frame["x"] + (columns[middle] + 0.5) / mask.shape[1] * frame["width"],
        frame["y"] + (rows[middle] + 0.5) / mask.shape[0] * frame["height"],
    )
    assert asked(view).startswith("Objects #6 and #12 become one object, #6: appeared.")
    page.keyboard.press("Control+Enter")
    toast(view, "#6 and #12 are pieces of one object: appeared")
    wait_listed(view, CHANGED - {12})
    page.wait_for_selector('[data-evidence="6"]')
    correct(view, "Take apart")
    assert "becomes 2 objects: #6, appeared and #12, appeared" in asked(view)
    page.keyboard.press("Control+Enter")
    wait_listed(view, CHANGED)
    assert [event.kind for event in added()] == [Kind.MERGE, Kind.SPLIT]


def best_keyframe(app: RunningApp, object_id: int) -> int:
    return app.workbench.catalogue.objects[object_id].sighting(1).keyframes[0]


def test_these_are_two_and_not_an_object_and_back(app, view, added) -> None:
    page = view.page
    select(view, 4)
    correct(view, "These are two")
    assert "Object #4 becomes 2 objects: #4, disappeared and #16, appeared." in asked(view)
    page.keyboard.press("Control+Enter")
    toast(view, "not one object but 2")
    wait_listed(view, CHANGED | {16})
    select(view, 16)
    correct(view, "Not an object")
    assert "Object #16 (appeared) is dropped" in asked(view)
    page.keyboard.press("Control+Enter")
    toast(view, "not an object: #4 now")
    wait_listed(view, CHANGED)
    dropped = page.locator('.oa-dropped[data-dropped="16"]')
    expect(dropped).to_contain_text("said by", timeout=PATIENCE_MS)
    assert not (app.workbench.points.visits[1].object_ids == 16).any()
    dropped.locator("button").click()
    assert "#16 is an object again: appeared" in asked(view)
    page.keyboard.press("Control+Enter")
    wait_listed(view, CHANGED | {16})
    assert [event.kind for event in added()] == [Kind.SPLIT, Kind.DROP, Kind.KEEP]


def test_picking_ends_with_escape_and_what_makes_no_sense_is_said(view, added) -> None:
    page = view.page
    select(view, 6)
    correct(view, "Same as")
    page.wait_for_selector("#oa-picking:not([hidden])")
    page.keyboard.press("Escape")
    expect(page.locator("#oa-picking")).to_be_hidden(timeout=PATIENCE_MS)
    select(view, 7)  # selects, and asks nothing
    assert page.locator("#oa-ask").count() == 0
    correct(view, "Same as")
    page.wait_for_selector("#oa-picking:not([hidden])")
    page.locator('.oa-row[data-object="6"]').click()
    toast(view, "seen on the same visits")
    correct(view, "Not an object")
    asked(view)
    page.keyboard.press("Escape")
    page.evaluate("() => O('confirmed', {choice: 'exploded', reason: ''})")
    page.evaluate("() => O('correct', 'explode')")
    page.evaluate("() => O('keep', 12)")
    toast(view, "nobody said that 12 is not an object")
    assert added() == []


def test_the_journal_lists_mine_or_all_and_brings_back_any_state(app, view, added) -> None:
    page, decisions = view.page, app.workbench.decisions
    select(view, 6)
    page.keyboard.press("Enter")
    toast(view, "Object #6 accepted")
    decisions.decide(12, ChangeLabel.STATIC, who="ben", reason="was there", seen_event_id=None)
    first, second = (event.id for event in added())
    page.get_by_role("tab", name="Journal").click()
    page.wait_for_selector(f'[data-event="{second}"]')
    page.locator(".oa-segments button", has_text="Mine").click()
    expect(page.locator(f'[data-event="{second}"]')).to_have_count(0, timeout=PATIENCE_MS)
    assert page.locator(f'[data-event="{first}"]').count() == 1
    page.locator(".oa-segments button", has_text="Everybody's").click()
    page.wait_for_selector(f'[data-event="{second}"]')

    entry = page.locator(f'[data-event="{first}"]')
    entry.hover()
    entry.locator(".oa-restore").click()
    text = asked(view)
    assert f"as it did after entry {first}" in text and "1 decision will no longer count (1 of ben)" in text
    page.locator("#oa-ask textarea").fill("ben was hasty")
    page.keyboard.press("Control+Enter")
    toast(view, f"back to how it was after entry {first}")
    assert 12 not in decisions.verdicts and 6 in decisions.verdicts
    restored = added()[-1]
    assert (restored.kind, restored.target_id, restored.why) == (Kind.RESTORE, first, "ben was hasty")
    page.wait_for_selector(f'[data-event="{second}"].oa-undone')
    page.keyboard.press("u")
    toast(view, "Undone: back to how it was")
    assert decisions.verdicts[12].who == "ben"
    page.wait_for_selector(f'[data-event="{second}"]:not(.oa-undone)')
    assert [event.kind for event in added()] == [Kind.ACCEPT, Kind.LABEL, Kind.RESTORE, Kind.UNDO]


def test_what_somebody_else_did_meanwhile_is_a_conflict_and_disagreement_is_marked(app, view, added) -> None:
    page, decisions = view.page, app.workbench.decisions
    select(view, 6)
    correct(view, "Merge with")
    page.wait_for_selector("#oa-picking:not([hidden])")
    page.locator('.oa-row[data-object="12"]').click()
    asked(view)
    decisions.decide(12, ChangeLabel.STATIC, who="ben", reason="", seen_event_id=None)
    page.keyboard.press("Control+Enter")
    toast(view, "Not saved: ben set object 12 to static")
    expect(page.locator(".oa-conflict")).to_contain_text("ben set object 12 to static")
    assert [event.who for event in added()] == ["ben"]

    correct(view, "Merge with")
    page.wait_for_selector("#oa-picking:not([hidden])")
    page.locator('.oa-row[data-object="12"]').click()
    asked(view)
    page.keyboard.press("Control+Enter")
    toast(view, "#6 and #12 are pieces of one object")
    row = page.locator('.oa-row[data-object="6"].oa-disputed')
    expect(row).to_have_count(1, timeout=PATIENCE_MS)
    expect(page.locator(".oa-conflict")).to_contain_text(
        "Inspectors disagree: ben says #12 is one object, static", timeout=PATIENCE_MS
    )
    page.locator(".oa-filters summary").click()
    page.get_by_label("Inspectors disagree").check()
    wait_listed(view, {6})
    page.get_by_label("Inspectors disagree").uncheck()
    wait_listed(view, CHANGED - {12})
    # Another person's correction takes the selected object away: the page follows it.
    made = corrections.merge(decisions.corrected, (4, 6))
    decisions.correct(made, who="ben", reason="", seen_event_id=None)
    page.wait_for_selector('[data-evidence="4"]')
    page.keyboard.press("u")
    toast(view, "What others decided since still counts.")
    assert added()[-1].kind is Kind.UNDO and decisions.corrected.objects[4].machine_ids == (4, 6, 12)


def test_where_others_are_is_shown_and_can_be_looked_at(app, view) -> None:
    page, bench = view.page, app.workbench

    def watch() -> None:
        """Ben's page needs no telling here."""

    bench.enter(-1, "ben", watch)
    try:
        bench.look_at(-1, 12)
        chip = page.locator("#oa-who button", has_text="#12")
        expect(chip).to_have_count(1, timeout=PATIENCE_MS)
        mark = (
            "() => getComputedStyle(document.querySelector('.oa-row[data-object=\"12\"]'), '::after').content"
        )
        assert page.evaluate(mark) == '"B"'
        chip.click()
        page.wait_for_selector('[data-evidence="12"]')
        assert [number for _, number in bench.others(-1)] == [12]
        bench.look_at(-1, 7)
        expect(page.locator("#oa-who button", has_text="#7")).to_have_count(1, timeout=PATIENCE_MS)
    finally:
        bench.leave(-1, watch)
    expect(page.locator("#oa-who button")).to_have_count(0, timeout=PATIENCE_MS)


def test_searching_by_number_selects_and_typing_decides_nothing(app, view, added) -> None:
    page, decisions = view.page, app.workbench.decisions
    page.get_by_role("tab", name="Journal").click()
    page.wait_for_selector(".oa-journal", state="visible")
    page.wait_for_selector("[data-search]", state="hidden")
    page.keyboard.press("/")
    page.keyboard.type("#1")
    wait_listed(view, {1, 10, 11, 12})
    page.keyboard.press("Backspace")
    page.keyboard.type("2")
    wait_listed(view, {2})
    page.keyboard.press("Enter")
    page.wait_for_selector('[data-evidence="2"]')
    assert page.evaluate("() => document.activeElement.tagName") != "INPUT"
    page.locator("[data-send=queue_all]").click()
    wait_listed(view, CHANGED)
    made = corrections.merge(decisions.corrected, (6, 12))
    decisions.correct(made, who="ben", reason="", seen_event_id=None)
    page.keyboard.press("/")
    page.keyboard.type("12")
    page.keyboard.press("Enter")
    page.wait_for_selector('[data-evidence="6"]')  # what #12 is part of now
    page.keyboard.press("/")
    page.keyboard.type("99")
    expect(page.locator("[data-role=narrowed]")).to_have_text("No object #99", timeout=PATIENCE_MS)
    page.keyboard.press("Enter")
    toast(view, "No object 99")
    assert [event.who for event in added()] == ["ben"]


def test_selecting_in_the_queue_flies_there_and_shows_the_best_keyframes(app, view) -> None:
    page, inspector = view.page, inspector_of(app)
    home = np.array(app.workbench.points.home.position)
    page.evaluate("() => O('overview')")
    view.wait_for(lambda: np.allclose(view_client(app).camera.position, home, atol=0.02), "the whole site")
    select(view, 12)
    middle = np.array(app.workbench.catalogue.objects[12].sighting(1).centroid_world_m)
    view.wait_for(
        lambda: np.linalg.norm(view_client(app).camera.look_at - middle) < 0.5, "the camera to look at it"
    )
    away = np.linalg.norm(np.array(view_client(app).camera.position) - middle)
    assert away < np.linalg.norm(home - middle)
    choices = inspector.choices
    assert app.workbench.catalogue.sees_well(choices.session, choices.keyframe, 12)
    crops = page.locator('[data-evidence="12"] .oa-crops img')
    expect(crops).to_have_count(2, timeout=PATIENCE_MS)
    assert min(crops.evaluate_all("images => images.map(image => image.naturalWidth)")) > 0


def test_filters_and_skip_and_progress(app, view, added) -> None:
    page = view.page
    if not page.locator(".oa-filters select").first.is_visible():
        page.locator(".oa-filters summary").click()
    page.locator("[data-send=queue_visit]").select_option("before")
    wait_listed(view, {8, 9, 10})
    expect(page.locator("[data-role=narrowed]")).to_have_text("3 of 9 listed")
    page.locator("[data-send=queue_visit]").select_option("both")
    wait_listed(view, {4, 5})
    page.locator("[data-send=queue_visit]").select_option("any")
    page.locator("[data-send=queue_size]").select_option("large")
    wait_listed(view, {6})
    page.locator("[data-send=queue_size]").select_option("any")
    page.locator("[data-send=queue_high]").fill("50")
    wait_listed(view, {10, 11})
    page.locator("[data-send=queue_all]").click()
    wait_listed(view, CHANGED)

    order = [item.object_id for item in inspector_of(app)._page.queue_order()]
    select(view, order[0])
    page.keyboard.press(".")
    page.wait_for_selector(f'[data-evidence="{order[1]}"]')
    expect(page.locator(".oa-group", has_text="Skipped")).to_have_count(1, timeout=PATIENCE_MS)
    assert [item.object_id for item in inspector_of(app)._page.queue_order()] == [*order[1:], order[0]]
    assert added() == []
    page.keyboard.press("Enter")
    expect(page.locator("[data-role=reviewed]")).to_have_text("1 of 9 decided", timeout=PATIENCE_MS)
    page.wait_for_selector(f'[data-evidence="{order[2]}"]')
    page.evaluate("() => O('queue_decided', 'open')")
    wait_listed(view, CHANGED - {order[1]})
    page.evaluate("() => O('queue_decided', 'done')")
    wait_listed(view, {order[1]})
    (event,) = added()
    assert (event.kind, event.object_id) == (Kind.ACCEPT, order[1])
