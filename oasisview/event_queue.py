"""Events of one tab: checked when they arrive, then handled one after the other."""

from __future__ import annotations

import asyncio
import inspect
import json
import logging
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from oasisview.events import OWN_KINDS, Parser
from pipeline.errors import OasisError

T = TypeVar("T")
Handler = Callable[[T], Awaitable[None] | None]

logger = logging.getLogger(__name__)

MAX_EVENT_CHARACTERS = 8 * 1024
MAX_WAITING = 256


@dataclass(frozen=True)
class _Registration:
    handler: Handler[Any]
    parse: Parser[Any]
    latest_only: bool


@dataclass(frozen=True)
class _Waiting:
    kind: str
    handler: Handler[Any]
    value: Any
    latest_only: bool


class EventQueue:
    """Parses, orders and dispatches the events of one tab.

    ``receive`` and ``put`` are called on the event loop; everything else may come from any thread.

    Args:
        report: shows a person that something they asked for did not work.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._registered: dict[str, _Registration] = {}
        self._waiting: deque[_Waiting] = deque()
        self._worker: asyncio.Task[None] | None = None
        self._closed = False

    def register(self, kind: str, handler: Handler[T], parse: Parser[T], *, latest_only: bool) -> None:
        """Handle a kind of event; a second registration replaces the first."""
        self._registered[kind] = _Registration(handler, parse, latest_only)

    def receive(self, message: str) -> None:
        """Take one message of the browser, ``{"k": kind, "v": value, ...}``; drops and logs what is wrong."""
        if len(message) > MAX_EVENT_CHARACTERS:
            logger.warning("dropped an event of %d characters", len(message))
            return
        try:
            fields = json.loads(message)
            kind = fields["k"]
            registration = self._registered.get(kind)
            if registration is None:
                # What the page sends by itself may go unheard; anything else is a mistake or an attack.
                level = logging.DEBUG if kind in OWN_KINDS else logging.WARNING
                logger.log(level, "dropped an event of the unknown kind %.40r", kind)
                return
            value = registration.parse(fields["v"])
        except RecursionError:
            logger.warning("dropped an event nested too deep")
        except (ValueError, TypeError, KeyError) as error:
            logger.warning("dropped the event %.80r: %s", message, error)
        else:
            self.put(kind, registration.handler, value, latest_only=registration.latest_only)

    def put(self, kind: str, handler: Handler[Any], value: Any, *, latest_only: bool = False) -> None:
        """Queue a call of ``handler`` behind everything that came before."""
        if self._closed:
            return
        if len(self._waiting) >= MAX_WAITING:
            logger.warning("dropped the event %s: %d are waiting already", kind, MAX_WAITING)
            return
        self._waiting.append(_Waiting(kind, handler, value, latest_only))
        if self._worker is None or self._worker.done():
            self._worker = asyncio.get_running_loop().create_task(self._handle_waiting())

    def close(self) -> None:
        """Drop what waits and take nothing more."""
        self._closed = True
        self._waiting.clear()

    async def _handle_waiting(self) -> None:
        while self._waiting:
            event = self._waiting.popleft()
            if event.latest_only and any(later.kind == event.kind for later in tuple(self._waiting)):
                continue
            try:
                if inspect.iscoroutinefunction(event.handler):
                    await event.handler(event.value)
                else:
                    outcome = await asyncio.to_thread(event.handler, event.value)
                    if inspect.isawaitable(outcome):
                        await outcome
            except OasisError as error:
                logger.info("the event %s was refused: %s", event.kind, error)
                self._report(str(error))
            except Exception:
                logger.exception("handling the event %s failed", event.kind)
                self._report("That did not work; the reason is in the server's log.")
