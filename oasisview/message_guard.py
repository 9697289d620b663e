"""What a connected browser may send: viser trusts its clients, this does not.

Stock viser lets any client open a public tunnel (``ShareUrlRequest``), fill the memory with uploads, and
set any attribute of a widget's state (``GuiUpdateMessage`` with other keys than ``value``). The filter
sits on the class through which messages to the server and to single clients both go.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Coroutine
from typing import Any

from viser import _messages
from viser.infra import _infra
from viser.infra._messages import Message

logger = logging.getLogger(__name__)

MAX_TEXT = 64 * 1024
MAX_ITEMS = 256
MAX_DEPTH = 3

ALLOWED_MESSAGES = frozenset(
    {
        "CommandTriggerMessage",
        "GetRenderResponseMessage",
        "GuiButtonHoldMessage",
        "GuiFormDirtyMessage",
        "GuiFormSubmitMessage",
        "GuiUpdateMessage",
        "LocalStorageGetItemResponseMessage",
        "SceneNodeClickMessage",
        "SceneNodeDragMessage",
        "ScenePointerMessage",
        "TransformControlsDragEndMessage",
        "TransformControlsDragStartMessage",
        "TransformControlsUpdateMessage",
        "ViewerCameraMessage",
    }
)


def is_plain_value(value: Any, depth: int = 0) -> bool:
    """Whether a widget value is finite, small and made of plain data only."""
    if value is None or isinstance(value, bool):
        return True
    if isinstance(value, int):
        return abs(value) < 2**53
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, str):
        return len(value) <= MAX_TEXT
    if isinstance(value, list | tuple):
        return (
            depth < MAX_DEPTH
            and len(value) <= MAX_ITEMS
            and all(is_plain_value(item, depth + 1) for item in value)
        )
    return False


def is_acceptable(message: Message) -> bool:
    """Whether a message of a browser may be handled at all."""
    if type(message).__name__ not in ALLOWED_MESSAGES:
        return False
    if isinstance(message, _messages.GuiUpdateMessage):
        updates = message.updates
        return isinstance(updates, dict) and updates.keys() == {"value"} and is_plain_value(updates["value"])
    return True


_stock_handle = _infra.WebsockMessageHandler._handle_incoming_message


async def _handle_acceptable(self: _infra.WebsockMessageHandler, client_id: Any, message: Message) -> None:
    if not is_acceptable(message):
        logger.warning("dropped a %s of client %s", type(message).__name__, client_id)
        return
    await _stock_handle(self, client_id, message)


def install() -> None:
    """Put the filter in force for all viser servers of this process; doing it twice changes nothing."""
    setattr(_infra.WebsockMessageHandler, "_handle_incoming_message", _handle_acceptable)  # noqa: B010


class _Probe(_infra.WebsockMessageHandler):
    def get_message_buffer(self) -> Any:
        raise NotImplementedError


def _run_to_end(coroutine: Coroutine[Any, Any, None]) -> None:
    # By hand, because asyncio.run refuses inside a running event loop; nothing here ever waits.
    try:
        coroutine.send(None)
    except StopIteration:
        return
    coroutine.close()
    raise RuntimeError("the dispatch of messages waited for something")


def _reaches_handler(message: Message) -> bool:
    probe = _Probe()
    reached: list[Message] = []
    probe.register_handler(type(message), lambda _, received: reached.append(received))
    _run_to_end(probe._handle_incoming_message(_infra.ClientId(-1), message))
    return bool(reached)


def is_in_force() -> bool:
    """Whether a harmless update arrives and the harmful ones do not, tried on the real dispatch."""
    harmless = _messages.GuiUpdateMessage("probe", {"value": "x"})
    harmful = (
        _messages.GuiUpdateMessage("probe", {"update_cb": ["x"]}),
        _messages.GuiUpdateMessage("probe", {"value": "x", "disabled": True}),
        _messages.GuiUpdateMessage("probe", {"value": "x" * (MAX_TEXT + 1)}),
        _messages.ShareUrlRequest(),
        _messages.ShareUrlDisconnect(),
    )
    previous_level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        return _reaches_handler(harmless) and not any(_reaches_handler(message) for message in harmful)
    finally:
        logger.setLevel(previous_level)
