"""The annotated change map in formats that other programs read, one file per format."""

from __future__ import annotations

from oasisview.export.exporter import Exporter, ReviewedResult
from oasisview.export.registry import FORMATS, export

__all__ = ["FORMATS", "Exporter", "ReviewedResult", "export"]
