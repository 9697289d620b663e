"""Images for the page over HTTP, from the viewer's own port and behind its own checks.

The browser names an asset by a key that is looked up; it never names a file. A key stands for content
that does not change, so browsers may keep it for good.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import quote

ASSET_PREFIX = "/asset/"


@dataclass(frozen=True)
class Asset:
    """What one ``/asset/<key>`` request is answered with."""

    content_type: str
    data: bytes


class AssetSource(Protocol):
    """Where assets come from."""

    def get(self, key: str) -> Asset | None:
        """The asset of a key, or None if there is none.

        Runs on a worker thread, several at once, so it may encode images but must be thread-safe.
        ``key`` comes from the browser: look it up, never build a path from it.
        """


def asset_url(key: str) -> str:
    """Address of an asset for ``<img src=...>``, already safe inside a quoted HTML attribute."""
    return ASSET_PREFIX + quote(key, safe="/")


class AssetTable:
    """Assets made on demand by registered functions; the most recent ones are kept encoded.

    Args:
        max_cached_bytes: encoded bytes kept in memory; older ones are made again when asked for.
    """

    def __init__(self, max_cached_bytes: int = 64 * 1024 * 1024) -> None:
        self._makers: dict[str, Callable[[], Asset | None]] = {}
        self._cached: OrderedDict[str, Asset] = OrderedDict()
        self._cached_bytes = 0
        self._max_cached_bytes = max_cached_bytes
        self._lock = threading.Lock()

    def register(self, key: str, make: Callable[[], Asset | None]) -> str:
        """Say how the asset of ``key`` is made; returns its URL. A known key gets the new function."""
        with self._lock:
            self._makers[key] = make
            self._forget(key)
        return asset_url(key)

    def get(self, key: str) -> Asset | None:
        """The asset of a key, from memory or freshly made; None if the key is unknown."""
        with self._lock:
            asset = self._cached.get(key)
            if asset is not None:
                self._cached.move_to_end(key)
                return asset
            make = self._makers.get(key)
        asset = make() if make is not None else None
        if asset is not None and len(asset.data) <= self._max_cached_bytes:
            with self._lock:
                # Another thread may have registered or made the same key meanwhile.
                if self._makers.get(key) is make:
                    self._forget(key)
                    self._cached[key] = asset
                    self._cached_bytes += len(asset.data)
                    while self._cached_bytes > self._max_cached_bytes:
                        _, oldest = self._cached.popitem(last=False)
                        self._cached_bytes -= len(oldest.data)
        return asset

    def _forget(self, key: str) -> None:
        known = self._cached.pop(key, None)
        if known is not None:
            self._cached_bytes -= len(known.data)
