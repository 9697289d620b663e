from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from oasisview.assets import Asset, AssetTable, asset_url


def test_made_once_and_kept() -> None:
    made: list[int] = []
    table = AssetTable()

    def make() -> Asset:
        made.append(1)
        return Asset("image/png", b"x")

    assert table.register("a", make) == "/asset/a"
    assert table.get("a") == table.get("a") == Asset("image/png", b"x")
    assert len(made) == 1
    assert table.get("b") is None


def test_registering_again_replaces() -> None:
    table = AssetTable()
    table.register("a", lambda: Asset("t", b"1"))
    assert table.get("a") == Asset("t", b"1")
    table.register("a", lambda: Asset("t", b"2"))
    assert table.get("a") == Asset("t", b"2")


def test_the_least_used_is_made_again_when_memory_is_short() -> None:
    made: list[str] = []
    table = AssetTable(max_cached_bytes=250)
    for key in "abc":
        table.register(key, lambda key=key: (made.append(key), Asset("t", key.encode() * 100))[1])
    for key in "abaca":
        table.get(key)
    assert made == ["a", "b", "c"]
    table.get("b")
    assert made == ["a", "b", "c", "b"]
    table.register("big", lambda: Asset("t", b"x" * 1000))
    assert len(table.get("big").data) == 1000  # type: ignore[union-attr]
    assert table._cached_bytes <= 250


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=40))
def test_urls_are_safe_in_attributes(key: str) -> None:
    url = asset_url(key)
    assert url.isascii() and not set(url) & set("\"'<>& ?#\n")
