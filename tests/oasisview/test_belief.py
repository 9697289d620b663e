from __future__ import annotations

import re

import numpy as np
import pytest

from oasisview.assets import AssetTable
from oasisview.belief import BeliefMoment, believed, labels_after, moments, row_at
from oasisview.catalogue import Catalogue
from oasisview.panels.belief_strip import course_words, slider_html, strip_html
from pipeline.result import ChangeLabel as L
from pipeline.result import Result


@pytest.fixture
def catalogue(small_result: Result) -> Catalogue:
    return Catalogue(small_result, AssetTable())


def test_moments_are_the_ends_of_submaps(catalogue: Catalogue) -> None:
    known = moments(catalogue)

    assert known == (BeliefMoment(0, 2), BeliefMoment(1, 5))
    assert [row_at(known, keyframe) for keyframe in range(6)] == [-1, -1, 0, 0, 0, 1]


def test_the_last_moment_is_the_result_and_earlier_ones_are_the_stored_rows(catalogue: Catalogue) -> None:
    belief = catalogue.result.belief
    for row in range(len(belief)):
        before, after = labels_after(catalogue, row)
        for column, object_id in enumerate(catalogue.objects):
            code = int(belief[row, column])
            assert before(object_id) == after(object_id) == (None if code == 255 else L(code))
            assert believed(catalogue, object_id)[row] == before(object_id)
    final = labels_after(catalogue, len(belief) - 1)[1]
    assert all(final(item.object_id) is item.label for item in catalogue.objects.values())
    assert labels_after(catalogue, None)[0](1) is None


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        ((L.STATIC, L.STATIC, L.STATIC), "static from the start"),
        ((None, L.UNKNOWN, L.APPEARED), "appeared from keyframe 30 on"),
        ((L.MOVED, L.STATIC, L.STATIC), "static from keyframe 20 on"),
        ((L.STATIC, L.MOVED, L.STATIC), "static from keyframe 30 on"),
    ],
)
def test_the_course_is_said_in_words(labels: tuple, words: str) -> None:
    known = tuple(BeliefMoment(row, 10 * row + 9) for row in range(3))
    assert course_words(known, labels) == words


def test_the_strip_tells_every_moment(catalogue: Catalogue) -> None:
    late = next(i for i in catalogue.objects if believed(catalogue, i)[0] is None)
    html = strip_html(catalogue, catalogue.objects[late], 1)

    assert re.findall(r'aria-label="(After[^"]*)"', html) == [
        "After keyframe 3: not met yet",
        f"After keyframe 6: {catalogue.objects[late].label.name.lower()}",
    ]
    assert html.count('aria-pressed="true"') == 1


def test_the_slider_speaks_of_keyframes() -> None:
    html = slider_html((BeliefMoment(0, 9), BeliefMoment(1, 19)), 0, 20)
    assert "as believed after keyframe 10 of 20" in html and 'min="-1" max="1" value="0"' in html


def test_a_belief_of_fewer_rows_than_submaps_is_no_error(catalogue: Catalogue, monkeypatch) -> None:
    monkeypatch.setattr(type(catalogue.result), "belief", np.zeros((0, 12), np.uint8))
    assert moments(catalogue) == ()
    assert strip_html(catalogue, catalogue.objects[1], None) == ""
