"""What helps people to understand a result, in a real browser: what-if, matrix, belief, patches, pictures."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from browser_harness import Tabs, ViewerPage, connected
from playwright.sync_api import Page, expect

from oasisview.app import RunningApp, start
from oasisview.inspector import Inspector
from oasisview.patch_links import story_of
from oasisview.scene.map_points import LABEL_RGB
from oasisview.what_if_limits import LIMIT_OF_KEY
from pipeline.result import ChangeLabel
from pipeline.settings import Settings

PATIENCE_MS = 30_000
WINDOW = (1366, 768)


@pytest.fixture(scope="module")
def app(_small_result_template: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningApp]:
    copy = shutil.copytree(_small_result_template, tmp_path_factory.mktemp("understanding") / "small.oasis")
    running = start(copy, port=0)
    yield running
    running.stop()


@pytest.fixture
def own_app(small_result_path: Path) -> Iterator[RunningApp]:
    """For tests that decide something."""
    running = start(small_result_path, port=0)
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
def view(_view_of_module: ViewerPage, chromium_page: Callable[..., Page]) -> ViewerPage:
    """One page for all tests, none of which decides anything."""
    _view_of_module.page.evaluate("() => { O('mode', 'after'); O('end_preview'); }")
    _view_of_module.page.get_by_role("tab", name="Evidence").click()
    return _view_of_module


def inspector_of(app: RunningApp) -> Inspector:
    (inspector,) = app.inspectors()
    return inspector


def drawn_like(app: RunningApp, view: ViewerPage, object_id: int, visit: int = 1) -> ChangeLabel:
    """The label whose colour the browser was told to draw most points of an object in."""
    bench = app.workbench
    assert bench is not None
    cloud = view.client.scene.get_handle_by_name(f"/map/{visit}/objects")
    own = bench.points.visits[visit].object_ids == object_id
    colour = np.median(np.asarray(cloud.colors)[own], axis=0)
    hues = {label: np.array(rgb, float) for label, rgb in LABEL_RGB[False].items()}
    # A label's colour is mixed with the muted own one.
    return min(hues, key=lambda label: float(np.abs(0.75 * hues[label] + 0.25 * 200 - colour).sum()))


def move_slider(view: ViewerPage, limit: str, value: int) -> None:
    slider = view.page.locator(f'[data-send="what_if_{limit}"]')
    slider.fill(str(value))


def test_sliders_relabel_list_preview_and_take_nothing_as_decided(app, view) -> None:
    page = view.page
    page.get_by_role("tab", name="What-if").click()
    expect(page.locator(".oa-what-if").nth(1)).to_contain_text("These are the limits of this result")
    before = drawn_like(app, view, 6)
    assert before is ChangeLabel.APPEARED

    move_slider(view, "change", 99)
    expect(page.locator('[data-limit="change"]')).to_have_text("99%", timeout=PATIENCE_MS)
    expect(page.locator('[data-limit="nu_min"]')).to_have_text("50%")
    expect(page.locator(".oa-preview")).to_have_count(0)  # evidence of 5 is 99.3 %: all stays

    page.locator('[data-send="what_if_rule"]', has_text="matches").click()
    page.wait_for_selector("[data-flips]")
    expect(page.locator(".oa-preview")).to_contain_text("decided by matches alone", timeout=PATIENCE_MS)
    page.locator('[data-send="what_if_tau_sigma"]').fill("100")
    row = page.locator('.oa-flip[data-object="1"]')
    expect(row).to_contain_text("same \u2192 gone and new, as two objects", timeout=PATIENCE_MS)
    view.wait_for(lambda: drawn_like(app, view, 1) is ChangeLabel.APPEARED, "the map to show the preview")

    row.click()
    page.wait_for_selector('[data-evidence="1"]')
    assert "static" in page.locator('[data-evidence="1"] [data-role=label]').inner_text()
    assert not (app.workbench.result.path / "review.sqlite").exists()

    page.locator(".oa-preview button").click()
    expect(page.locator(".oa-preview")).to_have_count(0, timeout=PATIENCE_MS)
    view.wait_for(lambda: drawn_like(app, view, 1) is ChangeLabel.STATIC, "the decided colours to return")
    expect(page.locator('[data-limit="change"]')).to_have_text("50%", timeout=PATIENCE_MS)
    assert not page.problems


def test_moves_need_the_chance_that_the_slider_asks_for(app, view) -> None:
    page = view.page
    page.get_by_role("tab", name="What-if").click()
    move_slider(view, "move", 95)
    expect(page.locator('[data-role="flips"]')).to_have_text("2 of 12 would change", timeout=PATIENCE_MS)
    expect(page.locator('.oa-flip[data-object="4"]')).to_contain_text("moved \u2192 gone and new")
    page.locator(".oa-reset").click()
    expect(page.locator(".oa-what-if").nth(1)).to_contain_text(
        "These are the limits of this result", timeout=PATIENCE_MS
    )
    own = str(LIMIT_OF_KEY["move"].step_of(Settings()))
    expect(page.locator('[data-send="what_if_move"]')).to_have_value(own, timeout=PATIENCE_MS)


def test_applying_is_one_journal_entry_with_the_limits_as_reason_and_one_undo_takes_it_back(
    own_app, open_viewer, small_result_path
) -> None:
    view = open_viewer(own_app.server, size=(900, 620))
    page = view.page
    page.wait_for_selector(".oa-row")
    page.get_by_role("tab", name="What-if").click()
    page.locator('[data-send="what_if_nu_min"]').fill("100")
    page.wait_for_selector("[data-flips]")
    shown = int(page.locator("[data-flips]").get_attribute("data-flips"))
    assert shown > 1
    own_app.workbench.decisions.decide(8, ChangeLabel.STATIC, who="bob", reason="", seen_event_id=None)
    expect(page.locator('.oa-flip[data-object="8"]')).to_contain_text("decided: kept", timeout=PATIENCE_MS)

    page.locator(".oa-apply").click()
    field = page.locator("#oa-ask textarea")
    expect(field).to_have_value("What if: place looked at 100% instead of 50%", timeout=PATIENCE_MS)
    field.press("Control+Enter")
    expect(page.locator("#oa-toast")).to_contain_text("by other limits", timeout=PATIENCE_MS)
    with sqlite3.connect(f"file:{small_result_path / 'review.sqlite'}?mode=ro", uri=True) as connection:
        rows = connection.execute("SELECT kind, why, details FROM events WHERE kind = 'what_if'").fetchall()
    ((_, why, details),) = rows
    assert why == "What if: place looked at 100% instead of 50%"
    assert len(json.loads(details)) == shown - 1
    decisions = own_app.workbench.decisions
    assert decisions.label_of(7) is ChangeLabel.UNKNOWN and decisions.label_of(8) is ChangeLabel.STATIC
    page.get_by_role("tab", name="Journal").click()
    expect(page.locator(".oa-entry").first).to_contain_text("other limits", timeout=PATIENCE_MS)

    page.keyboard.press("u")
    view.wait_for(lambda: decisions.label_of(7) is ChangeLabel.APPEARED, "the undo")
    assert decisions.label_of(8) is ChangeLabel.STATIC


def test_matrix_cells_are_walked_by_keys_say_their_case_and_show_their_pair(app, view) -> None:
    page = view.page
    page.evaluate("() => O('select', 8)")
    page.wait_for_selector('[data-evidence="8"]')
    value = page.locator('[data-evidence="8"] .oa-heat button.oa-cell').first
    value.focus()
    assert value.evaluate("node => document.activeElement === node")
    assert "patches" in (value.get_attribute("aria-label") or "") or "\u03c3" in value.get_attribute(
        "aria-label"
    )

    page.get_by_role("tab", name="Matrix").click()
    table = page.locator("[data-grid]")
    assert table.locator("th button img").count() == table.locator("th").count()
    stops = table.locator('button.oa-cell[tabindex="0"]')
    expect(stops).to_have_count(1)
    stops.focus()
    camera = view.client.camera.position
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowDown")
    focused = page.evaluate("() => document.activeElement.dataset.words")
    assert focused and "before" in focused
    expect(page.locator(".oa-cell-words")).to_have_text(focused)
    assert np.allclose(view.client.camera.position, camera)  # the arrows did not drive the camera

    words = page.locator('[data-words^="#8 before, #7 after"]')
    assert "case 3: looks alike" in words.get_attribute("data-words")
    words.focus()
    page.keyboard.press("Enter")
    page.wait_for_selector('[data-pair="8-7"]')
    page.locator('[data-send="matrix_kind"]', has_text="quality").click()
    expect(page.locator('[data-words^="#8 before, #7 after"]')).to_contain_text("0.55", timeout=PATIENCE_MS)
    page.locator('[data-send="matrix_kind"]', has_text="patches").click()

    page.locator('[data-send="matrix_around"]', has_text="neighbours").click()
    expect(page.locator(".oa-window")).to_have_count(1, timeout=PATIENCE_MS)
    first = table.locator("tr").nth(1).locator("th button").get_attribute("title")
    page.locator('[data-send="matrix_move"][title="Move down"]').click()
    view.wait_js(
        "title => document.querySelectorAll('[data-grid] tr')[1].querySelector('th button').title !== title",
        first,
    )
    page.locator('[data-send="matrix_span"][title^="More"]').click()
    expect(table.locator("tr")).to_have_count(9, timeout=PATIENCE_MS)  # 8 rows and the head: all there is
    table.locator("th button").nth(3).click()
    page.wait_for_function("() => document.querySelector('.oa-own-number')")
    page.locator('[data-send="matrix_span"][title^="Fewer"]').click()
    assert not page.problems


def test_belief_is_seen_in_the_strip_and_the_map_follows_slider_and_band(app, view) -> None:
    page = view.page
    slow = next(i for i in app.workbench.catalogue.objects.values() if i.object_id == 5)
    page.evaluate("id => O('select', id)", slow.object_id)
    page.wait_for_selector(f'[data-evidence="{slow.object_id}"]')
    cells = page.locator(".oa-belief button")
    expect(cells).to_have_count(2)
    assert cells.first.get_attribute("aria-label") == "After keyframe 3: unknown"
    assert cells.last.get_attribute("aria-label") == "After keyframe 6: moved"

    cells.first.click()
    bar = page.locator("#oa-preview")
    expect(bar).to_contain_text("as believed after keyframe 3 of 6", timeout=PATIENCE_MS)
    page.wait_for_function("() => document.querySelector('[data-part=jump]').value === '3'")
    view.wait_for(lambda: drawn_like(app, view, 5) is ChangeLabel.UNKNOWN, "the map of that moment")
    expect(page.locator('.oa-belief button[aria-pressed="true"]')).to_have_count(1, timeout=PATIENCE_MS)

    slider = bar.get_by_role("slider")
    slider.fill("1")
    expect(bar).to_contain_text("after keyframe 6 of 6")
    view.wait_for(lambda: drawn_like(app, view, 5) is ChangeLabel.MOVED, "the map of the later moment")
    page.wait_for_function("() => document.querySelector('[data-part=jump]').value === '6'")

    page.locator('[data-part="jump"]').fill("1")
    expect(bar).to_contain_text("before anything was believed", timeout=PATIENCE_MS)
    expect(bar.get_by_role("slider")).to_have_value("-1", timeout=PATIENCE_MS)

    page.get_by_role("tab", name="What-if").click()
    move_slider(view, "move", 95)  # another preview takes its place
    expect(bar).to_contain_text("what if", timeout=PATIENCE_MS)
    page.locator('#oa-hud [data-send="belief"]').click()
    expect(bar).to_contain_text("before anything was believed", timeout=PATIENCE_MS)
    expect(page.locator(".oa-what-if").nth(1)).to_contain_text("These are the limits of this result")
    bar.locator("button").click()
    expect(bar).to_be_empty(timeout=PATIENCE_MS)
    view.wait_for(lambda: drawn_like(app, view, 5) is ChangeLabel.MOVED, "what has been decided")
    assert not page.problems


def test_a_clicked_patch_shows_its_match_in_the_other_picture(app, view) -> None:
    page = view.page
    page.evaluate("() => O('keyframe', {session: 1, keyframe: 1})")
    view.wait_js("() => document.querySelector('[data-part=this] figcaption').innerText.includes('kf 2')")
    catalogue = app.workbench.catalogue
    pair = (catalogue.covisible(1, 1).other_keyframe, 1)
    u, v = 0.31, 0.62
    frame = page.locator('[data-part="this"] .oa-frame').bounding_box()
    page.mouse.click(frame["x"] + u * frame["width"], frame["y"] + v * frame["height"])
    words = page.locator('[data-part="other"] .oa-patch-words')
    expect(words).to_contain_text("Best match", timeout=PATIENCE_MS)

    story = story_of(catalogue.result.links(*pair), 1, u, v)
    assert f"{story.match.score:.2f}" in words.inner_text()
    line = page.locator(".oa-lines line.oa-match:not(.oa-under)")
    expect(line).to_have_count(1, timeout=PATIENCE_MS)
    other = page.locator('[data-part="other"] .oa-frame').bounding_box()
    box = page.locator(".oa-pictures").bounding_box()
    ends = [float(line.get_attribute(name)) for name in ("x1", "y1", "x2", "y2")]
    (u0, v0), (u1, v1) = story.match.before, story.match.after
    wanted = [
        other["x"] - box["x"] + u0 * other["width"], other["y"] - box["y"] + v0 * other["height"],
        frame["x"] - box["x"] + u1 * frame["width"], frame["y"] - box["y"] + v1 * frame["height"],
    ]  # fmt: skip
    assert np.allclose(ends, wanted, atol=1.5)
    assert page.locator(".oa-lines line.oa-rival:not(.oa-under)").count() == len(story.rivals)

    page.locator('[data-send="patch_clear"]').click()
    expect(page.locator(".oa-lines")).to_have_count(0, timeout=PATIENCE_MS)

    page.evaluate("() => O('select', 1)")
    page.wait_for_selector('[data-evidence="1"]')
    page.evaluate("() => O('best_view')")
    page.locator('#oa-band [data-send="links"]').click()
    expect(page.locator(".oa-lines line.oa-object").first).to_be_attached(timeout=PATIENCE_MS)
    page.locator('#oa-band [data-send="links"]').click()
    expect(page.locator(".oa-lines")).to_have_count(0, timeout=PATIENCE_MS)
    assert not page.problems


def test_swipes_of_one_viewpoint_move_together_and_let_clicks_through(app, view) -> None:
    page = view.page
    page.evaluate("() => { O('select', 6); O('keyframe', {session: 1, keyframe: 2}); }")
    page.wait_for_selector('[data-evidence="6"]')
    page.locator('#oa-band [data-send="swipe"]').click()
    band, crop = page.locator("#oa-band [data-swipe]"), page.locator(".oa-swipe [data-swipe]")
    expect(band).to_have_count(1, timeout=PATIENCE_MS)
    expect(crop).to_have_count(1, timeout=PATIENCE_MS)
    sizes = "() => [...document.querySelectorAll('img.oa-under, img.oa-over')].map(i => i.naturalWidth)"
    view.wait_for(lambda: len(page.evaluate(sizes)) == 4 and min(page.evaluate(sizes)) > 0, "four pictures")
    addresses = page.eval_on_selector_all("#oa-band .oa-frame img", "images => images.map(i => i.src)")
    assert "/same/1/2.jpg" in addresses[1] and "/image/1/2.jpg" in addresses[0]  # before over after

    band.fill("30")
    expect(crop).to_have_value("30")
    over = page.locator("#oa-band .oa-over")
    assert "70%" in over.evaluate("node => getComputedStyle(node).clipPath")
    page.evaluate("() => O('step_keyframe', 1)")
    view.wait_js("() => document.querySelector('[data-part=this] figcaption').innerText.includes('kf 4')")
    expect(page.locator("#oa-band [data-swipe]")).to_have_value("30", timeout=PATIENCE_MS)

    frame = page.locator('[data-part="this"] .oa-frame').bounding_box()
    page.mouse.click(frame["x"] + 0.8 * frame["width"], frame["y"] + 0.55 * frame["height"])
    expect(page.locator('[data-part="other"] .oa-patch-words')).to_be_visible(timeout=PATIENCE_MS)
    page.locator('[data-send="patch_clear"]').click()
    page.keyboard.press("x")
    expect(page.locator("[data-swipe]")).to_have_count(0, timeout=PATIENCE_MS)
    assert not page.problems


def test_the_other_visit_stands_in_the_map_as_a_ghost(app, view) -> None:
    page = view.page
    visits = app.workbench.points.visits
    assert view.client.scene.get_handle_by_name("/map/ghost") is None
    page.locator("summary", has_text="Layers").click()
    page.locator('[data-key="ghost"]').check()

    def ghost() -> np.ndarray | None:
        handle = view.client.scene.get_handle_by_name("/map/ghost")
        return None if handle is None else np.asarray(handle.points)

    def shows(visit: int) -> bool:
        drawn, whole = ghost(), visits[visit].objects
        return drawn is not None and 0 < len(drawn) < len(whole) / 2 and drawn[1] in whole

    view.wait_for(lambda: shows(0), "the earlier visit's objects in the later map")
    view.wait_js("() => !!window.__viserMutable.nodeRefFromName['/map/ghost']")
    page.evaluate("() => O('mode', 'before')")
    view.wait_for(lambda: shows(1), "the later visit's objects in the earlier map")
    page.evaluate("() => O('mode', 'both')")
    view.wait_for(lambda: ghost() is None, "no ghost where both are shown")
    page.evaluate("() => { O('layer', {key: 'ghost', value: false}); O('mode', 'after'); }")
    view.wait_for(lambda: not inspector_of(app).choices.layers.ghost, "the layer to be off")
    assert ghost() is None
    assert not page.problems
