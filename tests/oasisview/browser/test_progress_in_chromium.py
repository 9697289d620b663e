from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser_harness import ViewerPage

from oasisview.app import RunningApp
from oasisview.job import Job, JobState
from pipeline.progress import ProgressEvent


class StagedJob:
    """A job whose states the test decides."""

    def __init__(self, result: Path) -> None:
        self.job = Job(Path("office/<monday>"), Path("office/friday"), result)
        self.state = JobState()
        self.cancelled = False

    def events(self) -> JobState:
        return self.state

    def cancel(self) -> None:
        self.cancelled = True
        if not self.state.is_over:
            self.state = JobState(error="cancelled; starting again goes on from where it was")


@pytest.fixture
def job(small_result_path: Path) -> StagedJob:
    return StagedJob(small_result_path)


@pytest.fixture
def app(job: StagedJob) -> Iterator[RunningApp]:
    running = RunningApp(job, host="127.0.0.1", port=0)  # type: ignore[arg-type]
    yield running
    running.stop()


def stages(**done: tuple[int, int]) -> dict[str, Any]:
    return {"progress": {name: ProgressEvent(name, *counts) for name, counts in done.items()}}


def test_progress_then_the_result_without_a_reload(
    job: StagedJob, app: RunningApp, open_viewer: Callable[..., ViewerPage]
) -> None:
    view = open_viewer(app.server)
    page = view.page
    page.wait_for_selector(".oa-progress")
    assert "<monday> with friday" in page.locator(".oa-progress h2").inner_text()
    job.state = JobState(**stages(open=(2, 2), map_previous=(3, 10)), warnings=("frame 7 was left out",))
    page.wait_for_selector('[data-stage="1"]')
    text = page.locator(".oa-progress").inner_text()
    assert "Mapping the previous visit" in text and "3 of 10" in text and "frame 7 was left out" in text
    page.evaluate(
        "() => { window.unloaded = false; window.addEventListener('unload', () => unloaded = true); }"
    )
    job.state = JobState(**stages(write=(1, 1)), result=job.job.result)
    page.wait_for_selector(".oa-row")
    page.wait_for_selector("#oa-band img")
    assert page.evaluate("() => window.unloaded") is False
    page.wait_for_function("() => document.querySelector('#oa-page').innerHTML === ''")


def test_a_failed_run_says_why(
    job: StagedJob, app: RunningApp, open_viewer: Callable[..., ViewerPage]
) -> None:
    view = open_viewer(app.server)
    job.state = JobState(error="the two visits never see the same place: check the poses")
    view.page.wait_for_selector("[data-role=error]")
    assert "never see the same place" in view.page.locator("[data-role=error]").inner_text()
    late = open_viewer(app.server)
    late.page.wait_for_selector("[data-role=error]")


def test_cancelling_from_the_page(
    job: StagedJob, app: RunningApp, open_viewer: Callable[..., ViewerPage]
) -> None:
    view = open_viewer(app.server)
    view.page.get_by_role("button", name="Cancel").click()
    view.page.wait_for_selector("[data-role=error]")
    assert job.cancelled
