"""The Export tab: every format arrives, long ones show how far they are and can be stopped."""

from __future__ import annotations

import io
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import laspy
import pytest
import trimesh
from browser_harness import ViewerPage
from playwright.sync_api import expect

from oasisview import export_actions
from oasisview.app import RunningApp, start
from oasisview.panels.export import Download
from pipeline.errors import StorageError
from pipeline.progress import ProgressEvent, Report

WINDOW = (1120, 700)


@pytest.fixture
def view(small_result_path: Path, open_viewer: Callable[..., ViewerPage]) -> Iterator[ViewerPage]:
    running: RunningApp = start(small_result_path, port=0)
    opened = open_viewer(running.server, size=WINDOW)
    opened.page.wait_for_selector(".oa-row")
    opened.page.get_by_role("tab", name="Export").click()
    yield opened
    running.stop()


def downloaded(view: ViewerPage, kind: str) -> tuple[str, bytes]:
    with view.page.expect_download() as download:
        view.page.locator(f'[data-format="{kind}"]').click()
    return download.value.suggested_filename, Path(download.value.path()).read_bytes()


def test_the_new_formats_arrive(view: ViewerPage, tmp_path: Path) -> None:
    name, report = downloaded(view, "report")
    assert name == "small_report.html" and report.startswith(b"<!DOCTYPE html>")
    name, content = downloaded(view, "geojson")
    assert name == "small.geojson" and len(json.loads(content)["features"]) == 12
    name, content = downloaded(view, "coco")
    assert name == "small_coco.json" and json.loads(content)["annotations"]
    name, content = downloaded(view, "laz")
    assert name == "small.laz" and "object_id" in laspy.read(io.BytesIO(content)).point_format.dimension_names
    name, content = downloaded(view, "glb")
    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb")
    assert name == "small.glb" and "object_1_session_1" in scene.geometry
    expect(view.page.locator(".oa-export .oa-status")).to_contain_text("small.glb was sent to your browser")


def test_a_long_export_shows_progress_and_stops(view: ViewerPage, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()

    def endless(result_path: Path, download: Download, report: Report) -> tuple[str, bytes]:
        for done in range(1, 10_000):
            report(ProgressEvent("export", min(done, 60), 100))
            if go_on.wait(0.02):
                break
        return "map.ply", b"ply"

    monkeypatch.setattr(export_actions, "make_download", endless)
    monkeypatch.setattr(export_actions, "SECONDS_BETWEEN_REPORTS", 0.05)
    page = view.page
    page.locator('[data-format="ply"]').click()
    page.wait_for_function("() => document.querySelector('.oa-status progress')?.value >= 0.3")
    expect(page.locator('[data-format="csv"]')).to_be_disabled()
    # Everything else goes on meanwhile.
    page.evaluate("() => O('select', 4)")
    page.wait_for_selector('[data-evidence="4"]')
    page.locator('[data-send="export_stop"]').click()
    expect(page.locator(".oa-export .oa-status")).to_contain_text("was stopped")
    expect(page.locator('[data-format="csv"]')).to_be_enabled()


def test_a_full_disk_is_said_in_words(view: ViewerPage, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: object) -> tuple[str, bytes]:
        raise StorageError("cannot write map.ply: the disk is full", "free some space")

    monkeypatch.setattr(export_actions, "make_download", full)
    view.page.locator('[data-format="ply"]').click()
    expect(view.page.locator(".oa-export .oa-status")).to_contain_text("the disk is full: free some space")
