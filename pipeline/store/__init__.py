"""The result folder: written atomically and resumably, opened lazily; no pickle anywhere.

``ResultWriter`` builds ``NAME.oasis.partial/`` beside the target and swaps it in when it is whole;
``open_result`` reads a finished folder behind the protocols of ``pipeline.result``.
"""

from __future__ import annotations

from pipeline.store.layout import SCHEMA_VERSION, ResultLayout
from pipeline.store.opened import StoredResult, StoredSession, finished_result, open_result, read_manifest
from pipeline.store.versions import library_versions
from pipeline.store.writer import ResultWriter

__all__ = [
    "SCHEMA_VERSION",
    "ResultLayout",
    "ResultWriter",
    "StoredResult",
    "StoredSession",
    "finished_result",
    "library_versions",
    "open_result",
    "read_manifest",
]
