from __future__ import annotations

from dataclasses import replace

import pytest

from oasisview.decisions import Verdict
from oasisview.priority import priority
from oasisview.queue_filter import QueueFilter, listed, queue_order
from pipeline.result import ChangeLabel, MapObject, Result

EVERY = frozenset(ChangeLabel)
DECIDED = Verdict(ChangeLabel.STATIC, False, "ann", "2026-03-10T08:00:00.000+00:00", "")


@pytest.fixture
def items(small_result: Result) -> list[MapObject]:
    return sorted(small_result.objects, key=lambda item: (-priority(item), item.object_id))


def ids(items: list[MapObject], chosen: QueueFilter, **options) -> list[int]:
    verdicts = options.pop("verdicts", {})
    return [item.object_id for item in queue_order(items, verdicts, chosen, **options)]


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"visit": "before"}, {8, 9, 10}),
        ({"visit": "now"}, {6, 7, 11, 12}),
        ({"visit": "both"}, {1, 2, 3, 4, 5}),
        ({"size": "large"}, {2, 3, 6}),
        ({"size": "medium"}, {1, 4, 5, 7, 8, 9, 10, 11, 12}),
        ({"size": "small"}, set()),
        ({"low_percent": 90}, {1, 2, 3}),
        ({"high_percent": 31}, {10, 11}),
        ({"low_percent": 80, "high_percent": 90}, {4, 5, 6, 7, 8, 9, 12}),
        ({"decided": "done"}, {6}),
        ({"decided": "open"}, set(range(1, 13)) - {6}),
        ({"disagreement": True}, {7}),
        ({"visit": "now", "decided": "open", "size": "large"}, set()),
    ],
)
def test_each_filter_lists_what_it_says(items: list[MapObject], changes: dict, wanted: set[int]) -> None:
    chosen = QueueFilter(EVERY, **changes)
    assert set(ids(items, chosen, verdicts={6: DECIDED}, disputed={7})) == wanted
    assert chosen.is_narrow and not QueueFilter(EVERY).is_narrow


def test_the_number_is_found_whatever_else_filters(items: list[MapObject]) -> None:
    narrow = QueueFilter(frozenset(), decided="done", visit="both")
    assert ids(items, replace(narrow, search="1")) == [1, 10, 11, 12]  # the exact number first
    assert ids(items, replace(narrow, search="#12 ")) == [12]
    assert ids(items, replace(narrow, search="# 7")) == [7]
    for nothing in ("99", "x", "#", "1a", "-1", "１"):
        assert ids(items, replace(narrow, search=nothing)) == []
    assert ids(items, replace(narrow, search="  ")) == []


def test_skipped_objects_come_after_what_is_open_in_the_order_of_skipping(items: list[MapObject]) -> None:
    plain = ids(items, QueueFilter())
    skipped = (plain[2], plain[0])
    order = ids(items, QueueFilter(), skipped=skipped)
    assert order == [plain[1], *plain[3:], *skipped]
    decided = ids(items, QueueFilter(), skipped=skipped, verdicts={plain[0]: DECIDED, 1: DECIDED})
    assert decided[-3] == plain[2] and set(decided[-2:]) == {plain[0], 1}


def test_progress_counts_by_label_whatever_else_filters(items: list[MapObject]) -> None:
    assert len(listed(items, {}, QueueFilter().labels)) == 9
    assert len(listed(items, {1: DECIDED}, QueueFilter().labels)) == 10
    assert listed(items, {}, frozenset()) == []
