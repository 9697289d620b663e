"""The report page, read by a parser of the standard library and, in Chromium, as it is printed."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest

from oasisview.export import export
from oasisview.export.report_words import moment
from oasisview.review import Journal
from pipeline.progress import ProgressEvent
from pipeline.result import ChangeLabel
from pipeline.store import open_result


class PageText(HTMLParser):
    """Elements with their attributes and texts; fails on markup that does not nest."""

    VOID = frozenset({"meta", "img", "br", "rect", "path", "line", "circle", "image", "polygon"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if data.strip() and self.open:
            self.texts.append((self.open[-1], data.strip()))

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture
def page_html(reviewed_path: Path, tmp_path: Path) -> str:
    export(reviewed_path, "report", tmp_path / "report.html")
    return (tmp_path / "report.html").read_text("utf-8")


def test_it_needs_nothing_else(page_html: str) -> None:
    page = PageText(page_html)
    assert page.all("script") == page.all("link") == page.all("iframe") == []
    for _, attributes in page.elements:
        for name in ("src", "href"):
            if name in attributes:
                assert attributes[name].startswith(("data:image/jpeg;base64,", "#"))
    style = page_html.split("<style>")[1].split("</style>", maxsplit=1)[0]
    assert "url(" not in style
    assert "@import" not in style


def test_every_change_is_numbered_in_plan_table_and_entries(page_html: str) -> None:
    page = PageText(page_html)
    # 4 and 5 moved, 6 was set to moved; 7 and 12 are new, 8 and 9 gone, 11 unknown; 10 was set to static.
    entries = [a for a in page.all("article")]
    assert [a["id"] for a in entries] == [f"change-{n}" for n in range(1, len(entries) + 1)]
    kinds = [a["class"].split()[1] for a in entries]
    assert kinds == ["c-moved"] * 3 + ["c-appeared"] * 2 + ["c-disappeared"] * 2 + ["c-unknown"]
    links = [a["href"] for a in page.all("a")]
    for entry in entries:
        assert links.count(f"#{entry['id']}") == 2  # from the plan and from the table
    ids = re.findall(r"<small>object #(\d+)</small>", page_html)
    assert sorted(map(int, ids[:3])) == [4, 5, 6]
    assert sorted(map(int, ids[3:5])) == [7, 12]


def test_pictures_are_jpegs_of_both_visits(page_html: str) -> None:
    page = PageText(page_html)
    pictures = [a["src"] for a in page.all("img")]
    assert len(pictures) >= 8
    for uri in [*pictures, page.all("image")[0]["href"]]:
        content = base64.b64decode(uri.removeprefix("data:image/jpeg;base64,"))
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        assert image.std() > 3  # not blank


def test_what_it_says(page_html: str) -> None:
    text = " ".join(content for _, content in PageText(page_html).texts)
    assert "before (2 March 2026, 09:00 UTC)" in text
    assert "after (9 March 2026, 09:30 UTC)" in text
    assert "Of 12 objects, 7 are changes: 3 moved, 2 new and 2 gone." in text
    assert "In 1 place a new object stands where another one was before." in text
    assert "=Ann checked 3 of the" not in text  # two people: =Ann and Ann
    assert "=Ann and Ann checked 3 of the 9 changed, corrected or undecided objects" in text
    assert "corrected the machine 2 times" in text
    assert "set by =Ann on" in text
    assert 'it, "stood" there; see photo' in text
    assert "Ann: look again" in text or "look again" in text
    assert "of its place was in view on the earlier visit" in text
    assert "frame 7 (rgb/00007.png) of after was left out: its pose is not rigid" in text


def test_people_cannot_write_markup(small_result_path: Path, tmp_path: Path) -> None:
    with Journal.of(open_result(small_result_path)) as journal:
        journal.decide(6, ChangeLabel.MOVED, who="<b>Eve</b>", why="<script>alert(1)</script>&amp;")
    export(small_result_path, "report", tmp_path / "report.html")
    html = (tmp_path / "report.html").read_text("utf-8")
    assert "<script" not in html
    page = PageText(html)
    assert any("<script>alert(1)</script>&amp;" in content for _, content in page.texts)
    assert "b" not in {tag for tag, content in page.texts if "Eve" in content}


def test_progress_runs_to_its_end(small_result_path: Path, tmp_path: Path) -> None:
    heard: list[ProgressEvent] = []
    export(small_result_path, "report", tmp_path / "report.html", heard.append)
    assert {event.stage for event in heard} == {"export"}
    assert heard[-1].done == heard[-1].total
    assert [event.done for event in heard] == sorted(event.done for event in heard)


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("2026-03-02T09:00:00Z", "2 March 2026, 09:00 UTC"),
        ("2026-03-02T09:00:00+02:00", "2 March 2026, 09:00 (+0200)"),
        ("2026-03-02T09:00:00", "2 March 2026, 09:00"),
        ("2026-03-02", "2 March 2026"),
        ("last spring", "last spring"),
        (None, "date not recorded"),
    ],
)
def test_times_are_shown_in_their_own_zone(written: str | None, read: str) -> None:
    assert moment(written) == read
