from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser_harness import CHROMIUM, Tabs, ViewerPage, connected, launch_chromium
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


@pytest.fixture(scope="module")
def shared_tabs(browser: Browser) -> Iterator[Tabs]:
    """Tabs that the tests of a module use one after the other: opening one costs seconds."""
    tabs = Tabs(browser)
    yield tabs
    tabs.close()


@pytest.fixture
def chromium_page(browser: Browser, request: pytest.FixtureRequest) -> Iterator[Callable[..., Page]]:
    """Opens tabs for one test; leaves pictures of all tabs behind when the test fails."""
    tabs = Tabs(browser)
    yield tabs.open
    called = request.node.stash.get(REPORTS, {}).get("call")
    if called is not None and called.failed:
        name = request.node.nodeid.rpartition("/")[2].translate(str.maketrans("/:[] ", "_____"))
        tabs.save(name)
        if "shared_tabs" in request.fixturenames:
            request.getfixturevalue("shared_tabs").save(f"{name}_shared")
    tabs.close()


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
