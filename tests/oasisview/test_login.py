from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from oasisview.login import SESSION_SECONDS, LoginThrottle, NameCookie, cleaned_name, same_secret


class Clock:
    def __init__(self) -> None:
        self.now = 1_000_000.0

    def __call__(self) -> float:
        return self.now


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=60))
def test_any_name_survives_the_cookie(name: str) -> None:
    cookie = NameCookie()
    value = cookie.issue(name)
    assert cookie.read(value) == name
    assert value.isascii() and not set(value) & set(' ",;\\=')
    assert NameCookie().read(value) is None


@given(st.text(max_size=100))
def test_anything_else_is_no_cookie(value: str) -> None:
    assert NameCookie().read(value) is None


def test_cookies_run_out() -> None:
    clock = Clock()
    cookie = NameCookie(clock)
    value = cookie.issue("ana")
    clock.now += SESSION_SECONDS - 1
    assert cookie.read(value) == "ana"
    clock.now += 2
    assert cookie.read(value) is None


def test_secrets_of_any_text_compare() -> None:
    assert same_secret("pässword", "pässword")
    assert not same_secret("passwore", "password")
    assert not same_secret("\ud800", "password")


def test_names() -> None:
    assert cleaned_name("  Ana \t María\n") == "Ana María"
    assert cleaned_name("x" * 61) is None
    assert cleaned_name("  ") is None
    assert cleaned_name("a\u202eb") is None  # would turn the journal's lines around


def test_each_further_failure_doubles_the_wait() -> None:
    clock = Clock()
    throttle = LoginThrottle(clock)
    for _ in range(throttle.FREE_ATTEMPTS - 1):
        throttle.failed("a")
    assert throttle.wait_s("a") == 0
    waits = []
    for _ in range(12):
        throttle.failed("a")
        waits.append(throttle.wait_s("a"))
    assert waits[:4] == [1.0, 2.0, 4.0, 8.0]
    assert waits[-1] == throttle.MAX_WAIT_S
    assert throttle.wait_s("b") == 0
    clock.now += throttle.MAX_WAIT_S
    assert throttle.wait_s("a") == 0
    throttle.succeeded("a")
    throttle.failed("a")
    assert throttle.wait_s("a") == 0


def test_many_addresses_do_not_fill_the_memory() -> None:
    throttle = LoginThrottle(Clock())
    for address in range(throttle.MAX_ADDRESSES + 100):
        throttle.failed(str(address))
    assert len(throttle._failures) == throttle.MAX_ADDRESSES
