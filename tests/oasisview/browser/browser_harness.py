"""A real Chromium on a real viewer: what tests need to drive it and to wait for it.

Software rendering on a busy machine stalls a page for seconds: waits are long, and no test asserts a
latency.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import viser
import viser.transforms as vtf
from playwright.sync_api import Browser, BrowserContext, Page, Playwright

from oasisview.access import GuardedServer

T = TypeVar("T")

WAIT_S = 40.0
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
# Software WebGL, said explicitly: builds differ in what they fall back to.
CHROMIUM_FLAGS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]
ARTIFACTS = Path(__file__).parents[2] / "artifacts"


def launch_chromium(playwright: Playwright) -> Browser:
    return playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=CHROMIUM_FLAGS)


def wait_for(condition: Callable[[], T], what: str, timeout_s: float = WAIT_S) -> T:
    """The first true value of ``condition``; fails the test after ``timeout_s``."""
    end = time.monotonic() + timeout_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError(f"waited {timeout_s:.0f} s in vain for {what}")
        time.sleep(0.02)


@dataclass
class ViewerPage:
    """One tab that shows a viewer, and the viewer's handle of it."""

    page: Page
    client: viser.ClientHandle
    server: GuardedServer

    def wait_for(self, condition: Callable[[], T], what: str, timeout_s: float = WAIT_S) -> T:
        """Like ``wait_for``, but lets the browser's own events through meanwhile."""

        def polled() -> T:
            self.page.evaluate("() => 0")
            return condition()

        return wait_for(polled, what, timeout_s)

    def wait_js(self, expression: str, argument: Any = None, timeout_s: float = WAIT_S) -> Any:
        """Wait until a JavaScript function of ``argument`` returns something true; returns it."""
        return self.page.wait_for_function(expression, arg=argument, timeout=timeout_s * 1000).json_value()

    def wait_node(self, name: str) -> None:
        """Wait until a node of the scene is mounted."""
        self.wait_js("name => !!window.__viserMutable.nodeRefFromName[name]", name)
        self.settle()

    def wait_shell(self) -> None:
        """Wait until the page has its shell and the 3D view its place."""
        self.wait_js("() => !!window.oasis && !!document.querySelector('[data-oa-view]')")

    def settle(self, frames: int = 3) -> None:
        """Let that many frames be drawn."""
        self.page.evaluate(
            "n => new Promise(done => { const step = () => n-- <= 0 ? done() : requestAnimationFrame(step);"
            " step(); })",
            frames,
        )

    def view_rect(self) -> tuple[float, float, float, float]:
        """Left, top, width and height of the 3D view in pixels of the window."""
        return tuple(
            self.page.evaluate(
                "() => { const r = window.__viserMutable.canvas.getBoundingClientRect();"
                " return [r.x, r.y, r.width, r.height]; }"
            )
        )

    def project(self, point_world: Any) -> tuple[float, float]:
        """Window pixel of a world point, (3,) metres, for the camera as the server knows it."""
        left, top, width, height = self.view_rect()
        camera = self.client.camera
        T_world_camera = vtf.SE3.from_rotation_and_translation(vtf.SO3(camera.wxyz), camera.position)
        x, y, z = T_world_camera.inverse() @ np.asarray(point_world, dtype=np.float64)
        assert z > 0, "the point is behind the camera"
        scale = height / 2 / np.tan(camera.fov / 2)
        return left + width / 2 + x / z * scale, top + height / 2 + y / z * scale

    def click_world(self, point_world: Any) -> None:
        """Click where a world point is seen; fails if something other than the 3D view is on top."""
        x, y = self.project(point_world)
        self.page.mouse.move(x, y)
        self.settle()
        top = self.page.evaluate("([x, y]) => document.elementFromPoint(x, y)?.tagName", [x, y])
        assert top == "CANVAS", f"{top} covers the 3D view at ({x:.0f}, {y:.0f})"
        self.page.mouse.click(x, y)

    def screenshot(self, name: str) -> Path:
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        path = ARTIFACTS / f"{name}.png"
        self.page.screenshot(path=path)
        return path


class Tabs:
    """Opens tabs, each a person of its own (own cookies, own storage)."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._contexts: list[BrowserContext] = []

    def open(self, url: str, size: tuple[int, int] = (1366, 768), **options: Any) -> Page:
        width, height = size
        context = self._browser.new_context(viewport={"width": width, "height": height}, **options)
        self._contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(WAIT_S * 1000)
        page.problems = []  # type: ignore[attr-defined]
        page.on("pageerror", lambda error: page.problems.append(str(error)))  # type: ignore[attr-defined]
        page.on(
            "console",
            lambda message: message.type == "error" and page.problems.append(message.text),  # type: ignore[attr-defined]
        )
        page.goto(url)
        return page

    def save(self, name: str) -> None:
        """Leave behind what every tab shows."""
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        for number, page in enumerate(page for context in self._contexts for page in context.pages):
            page.screenshot(path=ARTIFACTS / f"{name}_{number}.png")
            (ARTIFACTS / f"{name}_{number}.html").write_text(page.content(), encoding="utf-8")
            (ARTIFACTS / f"{name}_{number}.txt").write_text("\n".join(page.problems), encoding="utf-8")

    def close(self) -> None:
        for context in self._contexts:
            context.close()


def connected(server: GuardedServer, page: Page, before: set[int]) -> ViewerPage:
    page.wait_for_function("() => window.__viserMutable && window.__viserMutable.canvas", timeout=60_000)
    # Viser's notice about software rendering covers what lies under it.
    page.add_style_tag(content="#webgl-software-rendering { display: none !important; }")
    new = wait_for(lambda: set(server.get_clients()) - before, "the tab to connect")
    return ViewerPage(page, server.get_clients()[new.pop()], server)
