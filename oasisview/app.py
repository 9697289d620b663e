"""The viewer: one server, one result, a page for everyone who connects.

``serve`` blocks until Ctrl-C; ``start`` returns at once, for tests and for embedding. Given a job, the
page shows its progress first and the result as soon as it is there, without a reload.
"""

from __future__ import annotations

import logging
import threading
import time
import webbrowser
from pathlib import Path
from typing import Protocol

import viser

from oasisview import events
from oasisview.access import GuardedServer
from oasisview.assets import AssetTable
from oasisview.inspector import Inspector
from oasisview.job import Job, JobState, start_job
from oasisview.panels.progress import message_html, progress_html
from oasisview.shell import Shell
from oasisview.workbench import Workbench
from pipeline.errors import OasisError
from pipeline.result import Result
from pipeline.store import open_result

PROGRESS_S = 0.3
_log = logging.getLogger(__name__)


class FollowedJob(Protocol):
    """A job at work, as the page follows it (``RunningJob``)."""

    job: Job

    def events(self) -> JobState:
        """The latest state."""

    def cancel(self) -> None:
        """Stop it; harmless when it is over."""


class RunningApp:
    """A viewer that is being served.

    Attributes:
        url: address of the page; login_url: the same with the token where one is demanded.
    """

    def __init__(
        self, source: Path | Job | FollowedJob, *, host: str, port: int, token: str | None = None
    ) -> None:
        """Open the result or start the job, then serve; ``start`` reads better."""
        # A wrong path is told in the terminal before anything listens.
        result = open_result(source) if isinstance(source, Path) else None
        self._assets = AssetTable()
        self._server = GuardedServer(host=host, port=port, token=token, assets=self._assets)
        self._lock = threading.RLock()
        self._stopped = threading.Event()
        self._pages: dict[int, _Page] = {}
        self._bench: Workbench | None = None
        self._message = ("Opening the result", "Large maps take some seconds.")
        self._job = source if not isinstance(source, Path | Job) else None
        self._started = time.monotonic()
        self.url = self._server.url
        self.login_url = self._server.login_url
        self._server.on_client_connect(self._connected)
        self._server.on_client_disconnect(self._disconnected)
        if isinstance(source, Job):
            self._job = start_job(source)
        work = (lambda: self._open(result)) if result is not None else self._follow_job
        self._worker = threading.Thread(target=work, name="oasisview-open", daemon=True)
        self._worker.start()

    @property
    def server(self) -> GuardedServer:
        """The server behind the page."""
        return self._server

    @property
    def workbench(self) -> Workbench | None:
        """The open result; None until it is open."""
        return self._bench

    def inspectors(self) -> list[Inspector]:
        """Everyone who has the result before them."""
        with self._lock:
            return [page.inspector for page in self._pages.values() if page.inspector is not None]

    def wait(self) -> None:
        """Block until :meth:`stop` is called from another thread."""
        while not self._stopped.wait(0.5):
            pass

    def stop(self) -> None:
        """Cancel the job, close the result and the port. Harmless when called twice."""
        if self._stopped.is_set():
            return
        self._stopped.set()
        if self._job is not None:
            self._job.cancel()
        self._worker.join(timeout=10)
        with self._lock:
            pages = list(self._pages.values())
        for page in pages:
            page.close()
        if self._bench is not None:
            self._bench.close()
        self._server.stop()

    # Work before the result is there

    def _follow_job(self) -> None:
        assert self._job is not None
        shown: JobState | None = None
        ticked = -1
        while not self._stopped.is_set():
            state = self._job.events()
            seconds = int(time.monotonic() - self._started)
            if state is not shown or seconds != ticked:
                shown, ticked = state, seconds
                self._to_waiting_pages(self._progress(state))
            if state.is_over:
                break
            time.sleep(PROGRESS_S)
        state = self._job.events()
        if self._stopped.is_set() or state.result is None:
            return
        try:
            self._open(open_result(state.result))
        except OasisError as error:
            self._fail(str(error))

    def _progress(self, state: JobState) -> str:
        job = self._job.job if self._job is not None else None
        names = [job.previous.name, job.current.name] if job is not None else []
        return progress_html(state, names, time.monotonic() - self._started)

    def _open(self, result: Result) -> None:
        try:
            bench = Workbench(result, self._assets)
        except OasisError as error:
            self._fail(str(error))
            return
        except Exception:
            _log.exception("the result could not be opened")
            self._fail("The result could not be opened; the reason is in the server's log.")
            return
        with self._lock:
            self._bench = bench
            pages = list(self._pages.values())
        for page in pages:
            page.open_result(bench)

    def _fail(self, message: str) -> None:
        self._message = ("The result cannot be shown", message)
        _log.error("%s", message)
        self._to_waiting_pages(message_html(*self._message))

    def _to_waiting_pages(self, content: str) -> None:
        with self._lock:
            pages = list(self._pages.values())
        for page in pages:
            page.show_waiting(content)

    # Browsers

    def _connected(self, client: viser.ClientHandle) -> None:
        page = _Page(client, self._server, self._cancel)
        with self._lock:
            self._pages[client.client_id] = page
            bench = self._bench
        if bench is not None:
            page.open_result(bench)
        elif self._job is not None and not self._job.events().is_over:
            page.show_waiting(self._progress(self._job.events()))
        else:
            state = self._job.events() if self._job is not None else None
            failed = state is not None and state.error is not None
            page.show_waiting(self._progress(state) if state and failed else message_html(*self._message))

    def _disconnected(self, client: viser.ClientHandle) -> None:
        with self._lock:
            page = self._pages.pop(client.client_id, None)
        if page is not None:
            page.close()

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.cancel()


class _Page:
    """One tab: what it waits for, then its inspector."""

    def __init__(self, client: viser.ClientHandle, server: GuardedServer, cancel: object) -> None:
        self._client = client
        self._server = server
        self._shell = Shell(client, server)
        self._hello: events.Hello | None = None
        self._bench: Workbench | None = None
        self._lock = threading.Lock()
        self._closed = False
        self.inspector: Inspector | None = None
        self._shell.on_event("hello", self._said_hello, events.hello)
        if callable(cancel):
            self._shell.on_event("cancel", lambda _: cancel())
        if not Shell.available():
            self._hello = events.Hello(None, 1366, 768)

    def show_waiting(self, content: str) -> None:
        """Show progress or a message over the whole page."""
        with self._lock:
            if self.inspector is None and not self._closed:
                self._shell.set_html("page", content)

    def open_result(self, bench: Workbench) -> None:
        """Show the result as soon as the page has said what it wants to see."""
        with self._lock:
            self._bench = bench
        self._try_open()

    def close(self) -> None:
        """The tab is gone."""
        with self._lock:
            self._closed = True
            inspector = self.inspector
        if inspector is not None:
            inspector.close()
        self._shell.close()

    def _said_hello(self, hello: events.Hello) -> None:
        with self._lock:
            self._hello = hello
        self._try_open()

    def _try_open(self) -> None:
        with self._lock:
            ready = self._hello is not None and self._bench is not None
            if not ready or self._closed or self.inspector is not None:
                return
            assert self._bench is not None
            self.inspector = Inspector(self._client, self._shell, self._bench, self._server.get_event_loop())
        self.inspector.open(self._hello)
        self._shell.set_html("page", "")


def start(
    source: Path | Job | FollowedJob, *, host: str = "127.0.0.1", port: int = 8080, token: str | None = None
) -> RunningApp:
    """Serve a result, or a job and then its result, and return at once; stop it with ``.stop()``.

    Args:
        source: a result folder, a job to start, or one that runs already.
        host: address to listen on; any but loopback demands a token.
        port: TCP port; 0 = a free one.
        token: what people log in with.

    Raises:
        InputError: no such result, or the port is taken.
    """
    return RunningApp(source, host=host, port=port, token=token)


def serve(
    source: Path | Job,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    open_browser: bool = True,
    token: str | None = None,
) -> None:
    """Serve until Ctrl-C; raises like :func:`start`, and ``KeyboardInterrupt`` when interrupted."""
    app = start(source, host=host, port=port, token=token)
    try:
        print(f"Viewer: {app.login_url}   (Ctrl-C ends it)", flush=True)
        if open_browser:
            webbrowser.open(app.login_url)
        app.wait()
    finally:
        app.stop()
