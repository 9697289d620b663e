"""Measuring, cutting, saved views and links, in a real browser."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from browser_harness import Tabs, ViewerPage, connected
from playwright.sync_api import Page, expect

from oasisview.app import RunningApp, start
from oasisview.saved_views import SavedViews

WINDOW = (1120, 700)


@pytest.fixture(scope="module")
def app(_small_result_template: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningApp]:
    folder = tmp_path_factory.mktemp("tools") / "small.oasis"
    running = start(Path(shutil.copytree(_small_result_template, folder)), port=0)
    yield running
    running.stop()


@pytest.fixture(scope="module")
def _view_of_module(app: RunningApp, shared_tabs: Tabs) -> ViewerPage:
    page = shared_tabs.open(app.login_url, WINDOW, permissions=["clipboard-read", "clipboard-write"])
    view = connected(app.server, page, set())
    page.wait_for_selector(".oa-row")
    view.wait_node("/map/1/objects")
    page.get_by_role("tab", name="Map", exact=True).click()
    page.wait_for_selector('[data-send="measure"]')
    return view


@pytest.fixture
def view(_view_of_module: ViewerPage, chromium_page: Callable[..., Page]) -> ViewerPage:
    """One page for all tests, with its map whole."""
    page = _view_of_module.page
    if page.locator('[data-role="cut"]').count():
        page.locator('[data-role="cut"] button').click()
        page.locator('[data-role="cut"]').wait_for(state="detached")
        page.wait_for_timeout(300)  # until the sliders are back at their ends
    page.evaluate("() => O('overview')")
    return _view_of_module


def shown_points(view: ViewerPage, name: str) -> int:
    """How many points of a cloud the browser has."""
    return view.page.evaluate(
        "name => { let found = 0; const node = window.__viserMutable.nodeRefFromName[name];"
        " node && node.traverse(n => { if (n.geometry && n.isPoints) found ="
        " n.geometry.attributes.position.count; }); return found; }",
        name,
    )


def test_two_clicks_measure_and_esc_steps_back(view: ViewerPage, app: RunningApp) -> None:
    page = view.page
    view.settle(10)
    points = app.workbench.points
    places = []
    for object_id in (1, 12):
        own = points.visits[1].objects[points.visits[1].object_ids == object_id] + points.origin
        # The point nearest to the camera is certainly not hidden by the object itself.
        places.append(own[np.argmin(np.linalg.norm(own - view.client.camera.position, axis=1))])
    page.keyboard.press("t")
    page.wait_for_selector('[data-role="tape"]')
    selected = page.evaluate("location.search")
    view.click_world(places[0])
    page.wait_for_function(
        "() => document.querySelector('[data-role=tape]').innerText.includes('First point')"
    )
    view.click_world(places[1])
    page.wait_for_selector('[data-measured="1"]')
    view.wait_node("/map/tape/lines")
    assert page.evaluate("location.search") == selected  # clicks measure, and select nothing
    said = page.locator('[data-measured="1"]').inner_text()
    length = float(said.split()[0]) / (100 if said.split()[1] == "cm" else 1)
    assert length == pytest.approx(float(np.linalg.norm(np.subtract(*places))), abs=0.15)
    page.keyboard.press("Escape")
    expect(page.locator("[data-measured]")).to_have_count(0)
    page.keyboard.press("Escape")
    expect(page.locator('[data-role="tape"]')).to_have_count(0)
    view.wait_js("() => !window.__viserMutable.nodeRefFromName['/map/tape/lines']")
    view.click_world(places[0])
    page.wait_for_function("() => new URLSearchParams(location.search).get('object') !== null")


def test_a_slider_cuts_the_map_and_one_button_brings_it_back(view: ViewerPage) -> None:
    page = view.page
    whole = shown_points(view, "/map/1/background")
    assert whole > 0
    slider = page.locator('[data-send="cut_height_high"]')
    slider.evaluate("e => { e.value = 0.5; e.dispatchEvent(new Event('input', {bubbles: true})); }")
    page.wait_for_selector('[data-role="cut"]')
    view.wait_for(lambda: 0 < shown_points(view, "/map/1/background") < whole, "the points to be cut")
    expect(slider.locator("xpath=following-sibling::output")).to_have_text("0.50")
    page.keyboard.press("c")
    view.wait_for(lambda: shown_points(view, "/map/1/background") == whole, "the points to come back")
    page.keyboard.press("c")
    view.wait_for(lambda: 0 < shown_points(view, "/map/1/background") < whole, "the same cut again")
    page.locator('[data-role="cut"] button').click()
    view.wait_for(lambda: shown_points(view, "/map/1/background") == whole, "the whole map")
    assert float(page.locator('[data-send="cut_height_high"]').input_value()) > 0.5


def test_cut_around_the_selected_object(view: ViewerPage) -> None:
    page = view.page
    whole = shown_points(view, "/map/1/background")
    page.locator('.oa-row[data-object="12"]').click()
    page.wait_for_selector('[data-evidence="12"]', state="attached")
    page.locator('[data-send="cut_around"]').click()
    page.wait_for_selector('[data-role="cut"]')
    view.wait_for(lambda: 0 < shown_points(view, "/map/1/background") < whole, "the points to be cut")


def test_a_saved_view_brings_everything_back_for_everybody(
    view: ViewerPage, app: RunningApp, chromium_page: Callable[..., Page]
) -> None:
    page = view.page
    page.locator('.oa-row[data-object="12"]').click()
    page.locator('[data-send="cut_around"]').click()
    page.wait_for_selector('[data-role="cut"]')
    page.locator("#oa-hud [data-value='\"both\"']").click()
    page.keyboard.press("y")
    page.locator("#oa-ask textarea").fill("By the <shelf>")
    page.keyboard.press("Control+Enter")
    row = page.locator('[data-send="fly_view"]', has_text="By the <shelf>")
    row.wait_for()
    (kept,) = SavedViews(app.workbench.result.path).all()
    assert (kept.name, kept.state.mode, kept.state.selected) == ("By the <shelf>", "both", 12)
    assert kept.state.cut is not None
    before = set(app.server.get_clients())
    other = connected(app.server, chromium_page(app.login_url, WINDOW), before)
    other.page.get_by_role("tab", name="Map", exact=True).click()
    other.page.locator('[data-send="fly_view"]', has_text="By the <shelf>").click()
    other.page.wait_for_selector('[data-role="cut"]')
    other.page.wait_for_function("() => new URLSearchParams(location.search).get('object') === '12'")
    other.wait_for(
        lambda: np.allclose(other.client.camera.position, kept.state.position, atol=0.05),
        "the camera to arrive",
    )
    other.page.get_by_role("button", name="Remove By the <shelf>").click()
    row.wait_for(state="detached")  # from the first page, too
    assert SavedViews(app.workbench.result.path).all() == ()


def test_the_link_to_a_finding_opens_it(view: ViewerPage, app: RunningApp) -> None:
    page = view.page
    page.locator('.oa-row[data-object="9"]').click()
    page.wait_for_function("() => new URLSearchParams(location.search).get('object') === '9'")
    page.get_by_role("tab", name="Evidence", exact=True).click()
    page.locator("[data-copy-link]").click()
    page.wait_for_function("() => document.querySelector('#oa-toast').innerText.includes('Link copied')")
    link = page.evaluate("() => navigator.clipboard.readText()")
    assert link.startswith(app.server.url) and "object=9" in link and "#" not in link
    page.locator('.oa-row[data-object="12"]').click()
    page.wait_for_selector('[data-evidence="12"]')
    page.evaluate("() => navigator.clipboard.writeText('')")
    page.keyboard.press("l")
    page.wait_for_function("async () => (await navigator.clipboard.readText()).includes('object=12')")
    page.get_by_role("tab", name="Map", exact=True).click()


def test_values_that_make_no_sense_change_nothing(view: ViewerPage) -> None:
    for kind, value in [
        ("cut_height_high", "low"), ("cut_depth_low", 1), ("fly_view", 0), ("fly_view", "1; drop"),
        ("remove_view", -1), ("remove_distance", 1.5), ("save_view", 7), ("measure", "now"),
    ]:  # fmt: skip
        view.page.evaluate("([kind, value]) => O(kind, value)", [kind, value])
    view.page.evaluate("() => O('fly_view', 999)")
    view.page.wait_for_function("() => document.querySelector('#oa-toast').innerText.includes('was removed')")
    assert view.page.locator('[data-role="cut"], [data-role="tape"]').count() == 0
