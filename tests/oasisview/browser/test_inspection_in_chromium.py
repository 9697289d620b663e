"""An inspector's work on the small result, in a real browser: every step of the main job."""

from __future__ import annotations

import csv
import io
import json
import shutil
import sqlite3
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from browser_harness import Tabs, ViewerPage, connected
from playwright.sync_api import Page, expect

from oasisview import wording
from oasisview.app import RunningApp, start
from oasisview.inspector import Inspector
from oasisview.matrix_window import display_order
from pipeline.result import ChangeLabel

# A busy machine draws a page in seconds, not milliseconds; never a measure of speed.
PATIENCE_MS = 30_000
# Software rendering costs by the pixel.
SMALL_WINDOW, TINY_WINDOW = (1120, 700), (760, 520)
OpenViewer = Callable[..., ViewerPage]


@pytest.fixture
def app(small_result_path: Path) -> Iterator[RunningApp]:
    running = start(small_result_path, port=0)
    yield running
    running.stop()


@pytest.fixture
def opened(app: RunningApp, open_viewer: OpenViewer) -> Callable[..., ViewerPage]:
    """Opens a page of the app and waits until the result is before the inspector."""

    def open_it(size: tuple[int, int] = SMALL_WINDOW) -> ViewerPage:
        view = open_viewer(app.server, size=size)
        wait_for_result(view)
        return view

    return open_it


def wait_for_result(view: ViewerPage) -> None:
    view.page.wait_for_selector(".oa-row")
    view.page.wait_for_selector("#oa-band img")
    view.wait_node("/map/1/objects")


@pytest.fixture(scope="module")
def shared_app(
    _small_result_template: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[RunningApp]:
    running = start(
        shutil.copytree(_small_result_template, tmp_path_factory.mktemp("shared") / "small.oasis"), port=0
    )
    yield running
    running.stop()


@pytest.fixture(scope="module")
def _view_of_module(shared_app: RunningApp, shared_tabs: Tabs) -> ViewerPage:
    page = shared_tabs.open(shared_app.login_url, SMALL_WINDOW)
    view = connected(shared_app.server, page, set())
    wait_for_result(view)
    return view


@pytest.fixture
def shared_view(
    shared_app: RunningApp, _view_of_module: ViewerPage, chromium_page: Callable[..., Page]
) -> ViewerPage:
    """One page for all tests that decide nothing, at the first keyframe and above the whole site."""
    view = _view_of_module
    view.page.get_by_role("tab", name="Evidence").click()
    view.page.evaluate(
        "() => { O('mode', 'after'); O('keyframe', {session: 1, keyframe: 0}); O('overview'); }"
    )
    wait_caption(view, "kf 1")
    home = shared_app.workbench.points.home.position
    view.wait_for(
        lambda: np.allclose(view.client.camera.position, home, atol=0.02), "the camera to see the whole site"
    )
    return view


def inspector_of(app: RunningApp, view: ViewerPage) -> Inspector:
    return next(i for i in app.inspectors() if i.client_id == view.client.client_id)


def select(view: ViewerPage, object_id: int) -> None:
    view.page.locator(f'.oa-row[data-object="{object_id}"]').click()
    view.page.wait_for_selector(f'[data-evidence="{object_id}"]')


def wait_caption(view: ViewerPage, text: str) -> None:
    """Wait until the first picture of the band is captioned so."""
    view.wait_js(
        "text => document.querySelector('[data-part=this] figcaption').innerText.includes(text)", text
    )


def journal_rows(result: Path) -> list[tuple]:
    with sqlite3.connect(f"file:{result / 'review.sqlite'}?mode=ro", uri=True) as connection:
        return connection.execute(
            "SELECT kind, object_id, old_label, new_label, why, who FROM events"
        ).fetchall()


def object_colour(app: RunningApp, view: ViewerPage, object_id: int) -> tuple[int, ...]:
    """The colour in which the browser was told to draw most points of an object of the later visit."""
    bench = app.workbench
    assert bench is not None
    cloud = view.client.scene.get_handle_by_name("/map/1/objects")
    colours = np.asarray(cloud.colors)[bench.points.visits[1].object_ids == object_id]
    return tuple(np.median(colours, axis=0).astype(int).tolist())


def test_scrubbing_shows_each_keyframe_with_its_counterpart_and_heatmaps(shared_view) -> None:
    view = shared_view
    page = view.page
    first = page.locator('[data-part="this"] img').get_attribute("src")
    page.keyboard.press("n")
    page.wait_for_function("() => document.querySelector('[data-part=jump]').value === '2'")
    second = page.locator('[data-part="this"] img').get_attribute("src")
    assert second != first
    assert "shared" in page.locator('[data-part="other"] figcaption').inner_text()
    slider = page.get_by_role("slider", name="Keyframe")
    slider.focus()
    for _ in range(3):
        slider.press("ArrowRight")
    wait_caption(view, "kf 5")
    sizes = page.eval_on_selector_all("#oa-band img", "images => images.map(i => i.naturalWidth)")
    assert len(sizes) == 4 and min(sizes) > 0
    page.locator('[data-part="jump"]').fill("1")
    wait_caption(view, "kf 1")
    page.locator('[data-part="visit"] button', has_text="Before").click()
    wait_caption(view, "Before")
    assert not page.problems


def test_clicking_objects_in_map_image_queue_and_matrix_shows_their_evidence(
    shared_app, shared_view, small_result
) -> None:
    app, view = shared_app, shared_view
    page = view.page
    wanted = small_result.object(12).sighting(1)
    view.settle(5)
    points = app.workbench.points
    own = points.visits[1].objects[points.visits[1].object_ids == 12] + points.origin
    # The point nearest to the camera is certainly not hidden by the object itself.
    nearest = own[np.argmin(np.linalg.norm(own - view.client.camera.position, axis=1))]
    view.click_world(nearest)
    page.wait_for_selector('[data-evidence="12"]')
    evidence = page.locator('[data-evidence="12"]').inner_text()
    assert "appeared" in evidence and "place looked at" in evidence and f"{wanted.coverage:.0%}" in evidence
    page.wait_for_function("() => location.search.includes('object=12')")

    page.locator('[data-part="this"] .oa-pic').click(position=centre_of_object(view, small_result, app, 4))
    page.wait_for_selector('[data-evidence="4"]')
    expect(page.locator('[data-part="this"] path.oa-line')).to_have_count(1, timeout=PATIENCE_MS)
    text = page.locator('[data-evidence="4"]').inner_text()
    assert "moved" in text and "82 cm" in text and "sure match" in text

    page.get_by_role("tab", name="Matrix").click()
    matrix = small_result.score_matrix
    rows, columns = display_order(matrix)
    row = int(np.flatnonzero(matrix.row_object_ids[rows] == 8)[0])
    column = int(np.flatnonzero(matrix.column_object_ids[columns] == 7)[0])
    grid = page.locator(".oa-grid")
    box = grid.bounding_box()
    rows, columns = matrix.sigma.shape
    grid.click(
        position={"x": (column + 0.5) / columns * box["width"], "y": (row + 0.5) / rows * box["height"]}
    )
    page.wait_for_selector('[data-pair="8-7"]')
    assert "looks alike" in page.locator('[data-pair="8-7"]').inner_text()
    page.locator('[data-pair="8-7"] figure').nth(1).click()
    view.wait_for(lambda: inspector_of(app, view).choices.selected == 7, "object 7 to be selected")
    assert not page.problems


def centre_of_object(view: ViewerPage, result, app: RunningApp, object_id: int) -> dict[str, float]:
    """Where an object is in the picture of the band, relative to the picture's tile."""
    choices = inspector_of(app, view).choices
    mask = result.sessions[choices.session].object_mask(choices.keyframe) == object_id
    assert mask.any()
    rows, columns = np.nonzero(mask)
    middle = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    u, v = (columns[middle] + 0.5) / mask.shape[1], (rows[middle] + 0.5) / mask.shape[0]
    # Read at once: the band may be drawn anew between two questions.
    frame = view.page.wait_for_function(
        """() => {
            const tile = document.querySelector('[data-part="this"] .oa-pic')?.getBoundingClientRect();
            const frame = document.querySelector('[data-part="this"] .oa-frame')?.getBoundingClientRect();
            return tile && frame && frame.width > 0
                ? {x: frame.x - tile.x, y: frame.y - tile.y, width: frame.width, height: frame.height}
                : null;
        }"""
    ).json_value()
    return {"x": frame["x"] + u * frame["width"], "y": frame["y"] + v * frame["height"]}


def test_an_override_is_on_disk_recolours_every_page_and_survives_undo_and_reload(
    app, opened, small_result_path
) -> None:
    mine, theirs = opened(), opened(TINY_WINDOW)
    before = object_colour(app, theirs, 12)
    select(mine, 12)
    mine.page.keyboard.press("1")
    mine.page.locator("#oa-ask textarea").fill("stood there <b>before</b>, hidden")
    mine.page.locator("#oa-ask textarea").press("Control+Enter")
    mine.page.wait_for_selector("#oa-toast.oa-shown")
    expect(mine.page.locator("#oa-toast")).to_contain_text(
        "Saved: Object #12 set to static", timeout=PATIENCE_MS
    )
    kind, object_id, old, new, why, who = journal_rows(small_result_path)[-1]
    assert (kind, object_id, old, new) == ("label", 12, ChangeLabel.APPEARED, ChangeLabel.STATIC)
    assert why == "stood there <b>before</b>, hidden" and who
    theirs.wait_for(lambda: object_colour(app, theirs, 12) != before, "the other page to recolour")
    theirs.page.wait_for_function(
        "() => document.querySelector('[data-role=reviewed]').innerText.startsWith('1 of')"
    )

    select(mine, 12)
    shown = mine.page.locator('[data-evidence="12"]')
    expect(shown.locator("[data-role=why]")).to_contain_text(
        "stood there <b>before</b>, hidden", timeout=PATIENCE_MS
    )
    assert shown.locator("[data-role=why] q b").count() == 0

    mine.page.keyboard.press("u")
    theirs.wait_for(lambda: object_colour(app, theirs, 12) == before, "the undo to reach the other page")
    assert journal_rows(small_result_path)[-1][0] == "undo"
    mine.page.keyboard.press("r")
    theirs.wait_for(lambda: object_colour(app, theirs, 12) != before, "the redo to reach the other page")

    mine.page.reload()
    mine.page.wait_for_selector('[data-evidence="12"]')
    label = "document.querySelector('[data-evidence=\"12\"] [data-role=label]')"
    mine.page.wait_for_function(f"() => {label}.innerText.includes('static')")
    mine.page.get_by_role("tab", name="Journal").click()
    expect(mine.page.locator(".oa-entry")).to_have_count(3, timeout=PATIENCE_MS)


def test_accepting_goes_through_the_queue_in_order(app, opened, small_result_path) -> None:
    view = opened(TINY_WINDOW)
    view.page.keyboard.press("j")
    view.page.wait_for_selector("[data-evidence]")
    first = int(view.page.locator("[data-evidence]").get_attribute("data-evidence"))
    view.page.keyboard.press("Enter")
    view.page.wait_for_function(
        "id => document.querySelector('[data-evidence]').dataset.evidence !== String(id)", arg=first
    )
    label = app.workbench.catalogue.objects[first].label
    user = inspector_of(app, view).user
    assert journal_rows(small_result_path) == [("accept", first, label, label, "", user)]
    view.page.wait_for_function(
        "() => document.querySelector('[data-role=reviewed]').innerText.startsWith('1 of 9')"
    )
    view.page.locator('[data-send="filter"][aria-label^="static"]').click()
    view.page.wait_for_function(
        "() => document.querySelector('[data-role=reviewed]').innerText.includes('of 12')"
    )


def test_exports_arrive_with_overrides_applied(app, opened, small_result_path, small_result) -> None:
    view = opened(TINY_WINDOW)
    view.page.locator('.oa-row[data-object="12"]').click()
    app.workbench.decisions.decide(12, ChangeLabel.STATIC, who="ann", reason="was there", seen_event_id=None)
    view.page.get_by_role("tab", name="Export").click()
    content = {kind: downloaded(view, kind) for kind in ("csv", "json", "ply", "heatmaps")}
    rows = {int(row["id"]): row for row in csv.DictReader(io.StringIO(content["csv"][1].decode()))}
    assert content["csv"][0] == "small.csv" and len(rows) == 12
    assert "static" in rows[12].values() and "appeared" in rows[12].values()
    assert "12" in json.dumps(json.loads(content["json"][1]))
    header, _, body = content["ply"][1].partition(b"end_header\n")
    count = int(next(line for line in header.splitlines() if line.startswith(b"element vertex")).split()[-1])
    layout = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3), ("session", "u1"), ("label", "u1"),
                       ("object_id", "<i4"), ("confidence", "<f4")])  # fmt: skip
    points = np.frombuffer(body, layout)
    assert len(points) == count == sum(len(s.points_world) for s in small_result.sessions)
    assert set(points["label"][points["object_id"] == 12]) == {ChangeLabel.STATIC}
    names = zipfile.ZipFile(io.BytesIO(content["heatmaps"][1])).namelist()
    assert sum(name.endswith(".semantic.tif") for name in names) == 12


def downloaded(view: ViewerPage, kind: str) -> tuple[str, bytes]:
    with view.page.expect_download() as download:
        view.page.locator(f'[data-format="{kind}"]').click()
    return download.value.suggested_filename, Path(download.value.path()).read_bytes()


def test_a_reload_finds_selection_keyframe_map_and_tastes_again(app, opened) -> None:
    view = opened()
    page = view.page
    select(view, 4)
    page.locator('[data-part="visit"] button', has_text="Before").click()
    wait_caption(view, "Before")
    page.locator('[data-part="jump"]').fill("5")
    wait_caption(view, "kf 5")
    page.locator('[data-send="mode"]', has_text="Both").click()
    page.locator('[data-send="theme"]').click()
    page.locator('[data-send="filter"][aria-label^="static"]').click()
    page.locator("summary", has_text="Layers").click()
    page.locator('[data-key="path"]').check()
    view.wait_for(lambda: inspector_of(app, view).choices.layers.path, "the layer")
    page.wait_for_function("() => JSON.parse(localStorage.getItem('oasisview'))?.layers.path")
    before = inspector_of(app, view).choices

    page.reload()
    page.wait_for_selector('[data-evidence="4"]')
    wait_caption(view, "kf 5")
    (again,) = [inspector for inspector in app.inspectors() if inspector.choices is not before]
    for name in ("selected", "session", "keyframe", "mode", "dark", "shown", "layers", "colours"):
        assert getattr(again.choices, name) == getattr(before, name), name
    assert again.choices.dark and again.choices.mode == "both" and again.choices.session == 0
    assert page.evaluate("() => document.documentElement.dataset.mantineColorScheme") == "dark"


def test_an_override_without_a_reason_says_so(app, opened, small_result_path) -> None:
    view = opened(TINY_WINDOW)
    page = view.page
    select(view, 12)
    page.evaluate("() => { O('decide', 'static'); O('reason', ' '); }")
    page.wait_for_function("() => document.querySelector('#oa-toast')?.innerText.includes('write a reason')")
    assert not (small_result_path / "review.sqlite").exists()
    page.locator("#oa-ask button", has_text="No reason").click()
    page.wait_for_function("() => document.querySelector('#oa-toast').innerText.includes('set to static')")
    assert [row[4] for row in journal_rows(small_result_path)] == [wording.NO_REASON]


def test_values_from_a_browser_that_make_no_sense_change_nothing(shared_app, shared_view) -> None:
    app, view = shared_app, shared_view
    journal = app.workbench.result.path / "review.sqlite"
    for kind, value in [
        ("select", 99999), ("select", "1; drop"), ("decide", "exploded"), ("scrub", -3), ("scrub", 10**9),
        ("keyframe", {"session": 7, "keyframe": 0}),
        ("pixel", {"session": 9, "keyframe": 0, "u": 0.5, "v": 0.5}),
        ("layer", {"key": "__class__", "value": True}), ("mode", "sideways"), ("export", "../../etc"),
        ("filter", None), ("colours", 3), ("reason", "without being asked"),
    ]:  # fmt: skip
        view.page.evaluate("([kind, value]) => O(kind, value)", [kind, value])
    view.page.evaluate("() => O('select', 4)")
    view.page.wait_for_selector('[data-evidence="4"]')
    choices = inspector_of(app, view).choices
    assert 0 <= choices.keyframe < 6 and choices.mode in ("before", "after", "both")
    assert not journal.exists()
