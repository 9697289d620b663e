from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview import events
from oasisview.event_queue import MAX_EVENT_CHARACTERS, MAX_WAITING, EventQueue
from oasisview.shell import escape

PARSERS = [
    events.nothing,
    events.flag,
    events.whole_number(0, 5),
    events.number(0, 1),
    events.choice("a", "b"),
    events.text(10),
    events.list_of(events.object_id, 3),
    events.record(a=events.flag),
    events.pixel_click,
    events.hello,
]
ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=8,
)


def run_apart(work: Coroutine[Any, Any, None]) -> None:
    """On a thread of its own: in this one, a browser of other tests may have an event loop running."""
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, work).result()


@given(ANY_JSON)
def test_a_parser_gives_a_value_or_a_value_error(value: Any) -> None:
    for parse in PARSERS:
        try:
            parse(value)
        except ValueError:
            continue


@pytest.mark.parametrize(
    ("parse", "good", "bad"),
    [
        (events.whole_number(0, 5), 5, [6, -1, True, 2.0, "2", None]),
        (events.number(0, 1), 0.5, [1.1, float("nan"), False, "0.5"]),
        (events.choice("a", "b"), "a", ["c", 1, ["a"]]),
        (events.object_id, 1, [0, 2**31, "1"]),
        (events.list_of(events.flag, 2), [True, False], [[True] * 3, [1], "x"]),
        (events.record(a=events.flag), {"a": True}, [{}, {"a": True, "b": 1}, {"a": 1}, [True]]),
        (events.nothing, None, [0, "", False]),
    ],
)
def test_parsers(parse: events.Parser[Any], good: Any, bad: list[Any]) -> None:
    assert parse(good) == good
    for value in bad:
        with pytest.raises(ValueError):
            parse(value)


def test_text_loses_what_cannot_be_read() -> None:
    assert events.text()("  two\nlines\x00\x1b[31m ") == "two\nlines[31m"


def greeting(search: object, remembered: object = None) -> dict[str, object]:
    return {"search": search, "remembered": remembered, "width": 1, "height": 1}


def test_hello_keeps_words_of_the_address_and_what_was_remembered() -> None:
    said = events.hello(greeting({"object": None, "keyframe": "2.3", "map": 7, "x": "y"}, {"dark": True}))
    assert said.address == {"keyframe": "2.3"} and said.remembered == {"dark": True}
    for nonsense in (None, [], "dark", 3):
        assert events.hello(greeting([], nonsense)).remembered == {}


def test_hello_ignores_links_that_make_no_sense() -> None:
    for asked, wanted in {"12": 12, "0": None, "-1": None, "²": None, "9" * 12: None, 3: None}.items():
        assert events.hello(greeting({"object": asked})).object_id == wanted
    assert events.hello(greeting(None)).object_id is None


def test_escape() -> None:
    assert escape('<a href="x">\'&') == "&lt;a href=&quot;x&quot;&gt;&#x27;&amp;"
    assert escape(3) == "3"


def message(kind: Any, value: Any = None) -> str:
    return json.dumps({"k": kind, "v": value, "n": 1})


async def settled(queue: EventQueue) -> None:
    while queue._worker is not None and not queue._worker.done():
        await asyncio.sleep(0.005)


def test_sync_and_async_handlers_keep_the_order() -> None:
    handled: list[Any] = []
    main: list[int] = []
    threads: set[int] = set()

    def slow_when_odd(value: int) -> None:
        threads.add(threading.get_ident())
        time.sleep(0.01 * (value % 2))
        handled.append(value)

    async def later(value: int) -> None:
        await asyncio.sleep(0.005)
        assert threading.get_ident() == main[0]
        handled.append(value)

    async def run() -> None:
        main.append(threading.get_ident())
        queue = EventQueue(report=pytest.fail)
        queue.register("sync", slow_when_odd, events.whole_number(0, 99), latest_only=False)
        queue.register("async", later, events.whole_number(0, 99), latest_only=False)
        for value in range(12):
            queue.receive(message("sync" if value % 3 else "async", value))
        await settled(queue)

    run_apart(run())
    assert handled == list(range(12))
    assert main[0] not in threads


def test_latest_only_skips_to_the_newest() -> None:
    handled: list[int] = []

    async def run() -> None:
        queue = EventQueue(report=pytest.fail)
        queue.register("scrub", handled.append, events.whole_number(0, 99), latest_only=True)
        for value in range(50):
            queue.receive(message("scrub", value))
        await settled(queue)

    run_apart(run())
    assert handled == [49]


def test_what_is_wrong_is_dropped(caplog: pytest.LogCaptureFixture) -> None:
    handled: list[Any] = []

    async def run() -> None:
        queue = EventQueue(report=pytest.fail)
        queue.register("text", handled.append, events.text(MAX_EVENT_CHARACTERS), latest_only=False)
        for wrong in (
            "",
            "{",
            "null",
            "[]",
            '"text"',
            '{"k": "text"}',
            '{"k": ["text"], "v": "x"}',
            message("unknown", "x"),
            message("text", 3),
            message("text", "x" * MAX_EVENT_CHARACTERS),
            '{"k": "text", "v": ' + "[" * 3000,
            '{"k": "text", "v": ' + "[" * 3000 + "]" * 3000 + "}",
        ):
            queue.receive(wrong)
        assert len(caplog.records) == 12, "each is logged"
        queue.receive(message("hello"))
        assert len(caplog.records) == 12, "nobody has to listen to what pages send by themselves"
        queue.receive(message("text", "right"))
        await settled(queue)
        queue.close()
        queue.receive(message("text", "too late"))
        await settled(queue)

    run_apart(run())
    assert handled == ["right"]


def test_a_flood_is_cut_off() -> None:
    handled: list[int] = []

    async def run() -> None:
        queue = EventQueue(report=pytest.fail)
        queue.register("pick", handled.append, events.object_id, latest_only=False)
        for value in range(1, MAX_WAITING + 500):
            queue.receive(message("pick", value))
        await settled(queue)

    run_apart(run())
    assert handled == list(range(1, MAX_WAITING + 1))
