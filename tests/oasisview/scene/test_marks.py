"""Names are drawn by event handlers and arranged by a timer: neither may trip over the other."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from oasisview.panels.hud import Layers
from oasisview.scene.marks import Marks
from pipeline.result import ChangeLabel

SIGHTING = SimpleNamespace(session=1, box_min_world_m=(0.0, 0.0, 2.0), box_max_world_m=(1.0, 1.0, 3.0))


class Handle:
    """As viser's: a removed one takes no new values."""

    def __init__(self, position: object, visible: bool) -> None:
        self.removed, self.position, self._visible = False, position, visible

    @property
    def visible(self) -> bool:
        return self._visible

    @visible.setter
    def visible(self, value: bool) -> None:
        if self.removed:
            raise RuntimeError("Cannot assign to 'visible' on a removed LabelHandle.")
        self._visible = value

    def remove(self) -> None:
        self.removed = True


class Scene:
    def __init__(self) -> None:
        self.handles: dict[str, Handle] = {}

    def _add(self, name: str, *_: object, **given: Any) -> Handle:
        self.handles[name] = Handle(given.get("position"), given.get("visible", True))
        return self.handles[name]

    add_label = add_frame = add_line_segments = _add

    def get_handle_by_name(self, name: str) -> Handle | None:
        if name == "/map/names":  # takes its children along
            for child in [n for n in self.handles if n.startswith(name + "/")]:
                self.handles.pop(child).remove()
        return self.handles.pop(name, None)


class Client:
    def __init__(self, in_atomic: threading.Event, go_on: threading.Event) -> None:
        self.scene = Scene()
        self.camera = SimpleNamespace(
            wxyz=np.array([1.0, 0, 0, 0]), position=np.zeros(3), fov=1.0, image_height=400, image_width=600
        )
        self._in_atomic, self._go_on = in_atomic, go_on

    @contextmanager
    def atomic(self) -> Iterator[None]:
        self._in_atomic.set()
        self._go_on.wait(0.5)
        yield


def test_names_are_not_replaced_while_they_are_arranged() -> None:
    in_atomic, go_on = threading.Event(), threading.Event()
    client = Client(in_atomic, go_on)
    item = SimpleNamespace(object_id=1, sighting=lambda session: SIGHTING)
    catalogue = SimpleNamespace(by_doubt=lambda: [item], result=SimpleNamespace(replaced=[]))
    points = SimpleNamespace(
        origin=np.zeros(3), up_world=np.array([0.0, -1.0, 0.0]), point_size_m=0.01, frustum_depth_m=0.1
    )
    rgb = {dark: dict.fromkeys(ChangeLabel, (1, 2, 3)) for dark in (False, True)}
    marks = Marks(
        cast(Any, client), cast(Any, catalogue), cast(Any, points), lambda _: ChangeLabel.APPEARED, rgb
    )
    marks.draw("after", Layers(), dark=False)
    marks.close()  # the test itself is the timer

    failures: list[BaseException] = []

    def arrange() -> None:
        try:
            marks._arrange()
        except BaseException as error:
            failures.append(error)

    arranging = threading.Thread(target=arrange)
    arranging.start()
    assert in_atomic.wait(5)
    marks.draw("after", Layers(), dark=True)
    go_on.set()
    arranging.join(5)
    marks.close()
    assert not failures
