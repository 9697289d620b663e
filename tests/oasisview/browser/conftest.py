from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser_harness import ARTIFACTS, CHROMIUM, ViewerPage, launch_chromium, wait_for
from playwright.sync_api import Browser, Page, sync_playwright

from oasisview.access import GuardedServer

HERE = Path(__file__).parent
REPORTS = pytest.StashKey[dict[str, pytest.TestReport]]()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.browser)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo) -> Iterator[Any]:
    report = yield
    item.stash.setdefault(REPORTS, {})[report.when] = report
    return report


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    with sync_playwright() as playwright:
        chromium = launch_chromium(playwright)
        yield chromium
        chromium.close()


@pytest.fixture
def chromium_page(browser: Browser, request: pytest.FixtureRequest) -> Iterator[Callable[..., Page]]:
    """Opens tabs, each a person of its own (own cookies); leaves screenshots when the test fails."""
    contexts = []

    def open_page(url: str, size: tuple[int, int] = (1366, 768), **options: Any) -> Page:
        width, height = size
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(40_000)
        page.problems = []  # type: ignore[attr-defined]
        page.on("pageerror", lambda error: page.problems.append(str(error)))  # type: ignore[attr-defined]
        page.on(
            "console",
            lambda message: message.type == "error" and page.problems.append(message.text),  # type: ignore[attr-defined]
        )
        page.goto(url)
        return page

    yield open_page
    called = request.node.stash.get(REPORTS, {}).get("call")
    pages = [page for context in contexts for page in context.pages]
    if called is not None and called.failed:
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        name = request.node.nodeid.rpartition("/")[2].translate(str.maketrans("/:[] ", "_____"))
        for number, page in enumerate(pages):
            page.screenshot(path=ARTIFACTS / f"{name}_{number}.png")
            (ARTIFACTS / f"{name}_{number}.html").write_text(page.content(), encoding="utf-8")
            (ARTIFACTS / f"{name}_{number}.txt").write_text("\n".join(page.problems), encoding="utf-8")
    for context in contexts:
        context.close()


@pytest.fixture
def open_viewer(chromium_page: Callable[..., Page]) -> Callable[..., ViewerPage]:
    """Opens a viewer in a new tab and waits until it is connected and draws."""

    def open_it(
        server: GuardedServer, *, query: str = "", size: tuple[int, int] = (1366, 768), **options: Any
    ) -> ViewerPage:
        before = set(server.get_clients())
        page = chromium_page(f"{server.url}{query}", size, **options)
        return connected(server, page, before)

    return open_it


def connected(server: GuardedServer, page: Page, before: set[int]) -> ViewerPage:
    page.wait_for_function("() => window.__viserMutable && window.__viserMutable.canvas", timeout=60_000)
    # Viser's notice about software rendering covers what lies under it.
    page.add_style_tag(content="#webgl-software-rendering { display: none !important; }")
    new = wait_for(lambda: set(server.get_clients()) - before, "the tab to connect")
    return ViewerPage(page, server.get_clients()[new.pop()], server)


@pytest.fixture
def guarded_server() -> Iterator[Callable[..., GuardedServer]]:
    """Starts guarded servers on free ports and stops them."""
    servers: list[GuardedServer] = []

    def start(**options: Any) -> GuardedServer:
        servers.append(GuardedServer(port=0, **options))
        return servers[-1]

    yield start
    for server in servers:
        server.stop()
