"""The engine of oasisview: two visits of a place in, an object-level change map out (OASIS-Map)."""

from __future__ import annotations

__version__ = "0.1.0"
