"""Pictures of the viewer at two window sizes, light and dark, with an object selected.

    python examples/04_screenshots.py RESULT OUT [--object ID]

Needs Playwright (``pip install playwright``) and a Chromium.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from oasisview.app import RunningApp, start

SIZES = ((1366, 768), (1920, 1080))
FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("result", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--object", type=int, help="object to select (default: the first of the queue)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    app = start(arguments.result, port=0)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
            for width, height in SIZES:
                page = browser.new_page(viewport={"width": width, "height": height})
                try:
                    take(page, app, arguments.object, arguments.out, f"{width}x{height}")
                finally:
                    page.close()
            browser.close()
    finally:
        app.stop()


def take(page: Page, app: RunningApp, wanted: int | None, out: Path, name: str) -> None:
    """Select an object, then save one picture a theme."""
    page.goto(app.login_url)
    page.wait_for_selector(".oa-row", timeout=60_000)
    page.wait_for_selector("#oa-band img", timeout=60_000)
    # Viser's notice about software rendering: true here, but not what the picture is about.
    page.add_style_tag(content="#webgl-software-rendering { display: none !important; }")
    if wanted is None:
        page.locator(".oa-row").first.click()
    else:
        page.evaluate("id => window.oasis.send('select', id)", wanted)  # a static one has no row
    page.wait_for_selector("[data-evidence]", timeout=60_000)
    page.wait_for_timeout(10_000)  # the camera flies, images and letters load
    page.screenshot(path=out / f"{name}_light.png")
    page.locator('[data-send="theme"]').click()
    page.wait_for_timeout(4_000)
    page.screenshot(path=out / f"{name}_dark.png")


if __name__ == "__main__":
    main()
