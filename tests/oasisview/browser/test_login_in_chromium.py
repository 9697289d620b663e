from __future__ import annotations

import urllib.parse
from collections.abc import Callable

from browser_harness import wait_for
from playwright.sync_api import Page

from oasisview.access import GuardedServer

NAME = 'Ana "María" <b>'


def test_a_person_logs_in_and_is_known_by_name(
    guarded_server: Callable[..., GuardedServer], chromium_page: Callable[..., Page]
) -> None:
    server = guarded_server(host="0.0.0.0")
    address = f"http://127.0.0.1:{server.get_port()}"
    page = chromium_page(f"{address}/?object=12")
    assert urllib.parse.urlsplit(page.url)[2:4] == ("/login", "object=12")

    page.fill("#name", NAME)
    page.fill("#token", "not the token")
    page.click("button")
    page.get_by_text("This token is not right.").wait_for()
    assert page.context.cookies() == []

    page.fill("#token", server.token or "")
    page.click("button")
    page.wait_for_function("() => window.__viserMutable && window.__viserMutable.canvas", timeout=30_000)
    client_id = wait_for(server.get_clients, "the tab to connect").popitem()[0]
    assert server.user_of_client(client_id) == NAME
    assert page.evaluate("() => new URLSearchParams(location.search).get('object')") == "12"
    (cookie,) = page.context.cookies()
    assert cookie["httpOnly"] and cookie["sameSite"] == "Strict"
    assert page.evaluate("() => document.cookie") == ""


def test_the_printed_address_carries_the_token_out_of_sight(
    guarded_server: Callable[..., GuardedServer], chromium_page: Callable[..., Page]
) -> None:
    server = guarded_server(token="a token with spaces & signs#")
    page = chromium_page(server.login_url)
    page.wait_for_function("() => location.hash === ''")
    assert page.input_value("#token") == server.token
    page.fill("#name", "Bo")
    page.keyboard.press("Enter")
    client_id = wait_for(server.get_clients, "the tab to connect").popitem()[0]
    assert server.user_of_client(client_id) == "Bo"
    assert page.problems == []  # type: ignore[attr-defined]
