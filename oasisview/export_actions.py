"""Downloads of one tab: made beside everything else the tab does, with progress, and stopped when asked.

Exports of large maps take minutes: on the tab's own queue of events they would hold up every click.
"""

from __future__ import annotations

import logging
import threading
import time

import viser

from oasisview.downloads import make_download
from oasisview.page import Page
from oasisview.panels.export import DOWNLOADS, Download
from oasisview.workbench import Workbench
from pipeline.errors import OasisError
from pipeline.progress import ProgressEvent, Warned

SECONDS_BETWEEN_REPORTS = 0.5
_log = logging.getLogger(__name__)


class _StoppedError(Exception):
    """The person does not want it any more."""


class ExportActions:
    """What the Export tab does.

    Args:
        client, page, bench: the tab, its panels and the open result.
        lock: held while the page's choices change.
    """

    def __init__(
        self, client: viser.ClientHandle, page: Page, bench: Workbench, lock: threading.RLock
    ) -> None:
        self._client = client
        self._page = page
        self._bench = bench
        self._lock = lock
        self._stop = threading.Event()
        self._running = False

    def download(self, format_name: str) -> None:
        """Start to write an export, which is sent to the browser when it is whole."""
        download = next(d for d in DOWNLOADS if d.format == format_name)
        with self._lock:
            if self._running:
                return  # the page shows what is being made, and how to stop it
            self._running = True
            self._stop.clear()
        self._say(f"Preparing {download.title} \u2026", share=0.0)
        threading.Thread(target=self._make, args=(download,), name="oasisview-export", daemon=True).start()

    def stop(self) -> None:
        """Give up what is being made; nothing of it stays."""
        self._stop.set()

    close = stop  # a page that is gone wants nothing any more

    def _make(self, download: Download) -> None:
        said_at = time.monotonic()

        def heard(event: ProgressEvent | Warned) -> None:
            nonlocal said_at
            if self._stop.is_set():
                raise _StoppedError
            now = time.monotonic()
            if isinstance(event, ProgressEvent) and now - said_at >= SECONDS_BETWEEN_REPORTS:
                said_at = now
                self._say(f"Preparing {download.title} \u2026", share=event.done / max(event.total, 1))

        try:
            name, content = make_download(self._bench.result.path, download, heard)
            if self._stop.is_set():
                raise _StoppedError
            self._client.send_file_download(name, content, save_immediately=True)
            said = f"{name} was sent to your browser ({len(content) / 1e6:.1f} MB)."
        except _StoppedError:
            said = f"{download.title} was stopped; nothing was written."
        except OasisError as error:
            said = str(error)
        except Exception:
            _log.exception("an export failed")
            said = f"{download.title} could not be made: see what the program printed."
        with self._lock:
            self._running = False
        self._say(said)

    def _say(self, status: str, share: float | None = None) -> None:
        with self._lock:
            self._page.choices.export_status = status
            self._page.choices.export_share = share
            self._page.show_export()
