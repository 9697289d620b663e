"""The exported report as a browser shows and prints it."""

from __future__ import annotations

import re
from pathlib import Path

from playwright.sync_api import Browser

from oasisview.export import export


def test_report_asks_for_nothing_fits_the_screen_and_prints_on_a4(
    browser: Browser, small_result_path: Path, tmp_path: Path
) -> None:
    export(small_result_path, "report", tmp_path / "report.html")
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    try:
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.goto((tmp_path / "report.html").as_uri())
        assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
        assert page.evaluate("document.documentElement.scrollWidth") <= 1366
        broken = "[...document.images].filter(i => !i.complete || !i.naturalWidth).length"
        assert page.evaluate(broken) == 0
        changes = page.locator("article.change").count()
        assert changes == page.locator("svg.plan a").count() > 0
        printed = page.pdf(prefer_css_page_size=True, print_background=True)
        assert printed.startswith(b"%PDF")
        boxes = re.findall(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)\s*\]", printed)
        assert 2 <= len(boxes) <= 8
        assert {(round(float(w)), round(float(h))) for w, h in boxes} == {(595, 842)}
        # Narrow windows stack the pictures below the words instead of cutting them off.
        page.set_viewport_size({"width": 420, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= 420
    finally:
        page.close()
