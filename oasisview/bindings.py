"""What the page's events and keys do: each is parsed, then handed to the inspector of the tab."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from oasisview import events
from oasisview.panels import queue
from oasisview.panels.export import DOWNLOADS
from oasisview.panels.hud import COLOURS, LAYER_WORDS, MODES
from oasisview.shell import Shell
from oasisview.wording import LABEL_NAMES, LABEL_OF_NAME

if TYPE_CHECKING:
    from oasisview.inspector import Inspector

_ANY_KEYFRAME = events.whole_number(0, 10_000_000)


def bind(inspector: Inspector, shell: Shell) -> None:
    """Connect everything that a page can send to what it does."""
    _bind_selection(inspector, shell)
    _bind_decisions(inspector, shell)
    _bind_map(inspector, shell)
    _bind_keyframes(inspector, shell)
    inspector.queue.bind()
    inspector.corrections.bind()
    inspector.matrix.bind()
    inspector.what_if.bind()
    inspector.belief.bind()
    inspector.patches.bind()
    _add_commands(inspector, shell)
    inspector.tools.bind()


def _bind_selection(inspector: Inspector, shell: Shell) -> None:
    on = shell.on_event
    on("select", lambda object_id: inspector.pick(object_id, fly=True), events.object_id)
    on("pixel", inspector.click_picture, events.pixel_click)
    on("swipe", lambda _: inspector.toggle_swipe())
    on("export", inspector.exports.download, events.choice(*(d.format for d in DOWNLOADS)))
    on("export_stop", lambda _: inspector.exports.stop())


def _bind_decisions(inspector: Inspector, shell: Shell) -> None:
    on, verdicts = shell.on_event, inspector.verdicts
    on("decide", lambda name: verdicts.ask(LABEL_OF_NAME[name]), events.choice(*LABEL_OF_NAME))
    on("reason", verdicts.give_reason, events.text())
    on("no_reason", lambda _: verdicts.give_no_reason())
    on("accept", lambda _: verdicts.accept())
    on("note", verdicts.note, events.text())
    on("undo", lambda _: verdicts.undo())
    on("redo", lambda _: verdicts.redo())


def _bind_map(inspector: Inspector, shell: Shell) -> None:
    on, controls = shell.on_event, inspector.controls
    layer = events.record(key=events.choice(*LAYER_WORDS), value=events.flag)
    on("mode", controls.set_mode, events.choice(*MODES))
    on("colours", controls.set_colours, events.choice(*COLOURS))
    on("layer", controls.set_layer, layer)
    on("theme", inspector.set_theme, events.flag)
    on("overview", lambda _: controls.fly_home())


def _bind_keyframes(inspector: Inspector, shell: Shell) -> None:
    on, choices = shell.on_event, inspector.choices
    on("scrub", lambda k: inspector.show_keyframe(choices.session, k), _ANY_KEYFRAME, latest_only=True)
    on("jump", lambda k: inspector.show_keyframe(choices.session, k - 1), _ANY_KEYFRAME, latest_only=True)
    on("step_keyframe", inspector.step_keyframe, events.whole_number(-1, 1))
    on("visit", inspector.set_visit, events.whole_number(0, 1))
    on(
        "keyframe",
        lambda place: inspector.show_keyframe(place["session"], place["keyframe"]),
        events.record(session=events.whole_number(0, 1), keyframe=_ANY_KEYFRAME),
    )
    on("best_view", lambda _: inspector.best_view())
    on("fly_keyframe", lambda _: inspector.controls.fly_keyframe())


def _add_commands(inspector: Inspector, shell: Shell) -> None:
    add, verdicts = shell.add_command, inspector.verdicts

    def asker(name: str) -> Callable[[], None]:
        return lambda: verdicts.ask(LABEL_OF_NAME[name])

    for number, label in enumerate(queue.LABEL_ORDER, start=1):
        add(f"Set label: {LABEL_NAMES[label]}", str(number), asker(LABEL_NAMES[label]))
    add("Undo", "U", verdicts.undo)
    add("Redo", "R", verdicts.redo)
    add("Before / after in the map", "B", inspector.controls.flip_mode)
    add("Next keyframe", "N", lambda: inspector.step_keyframe(1))
    add("Previous keyframe", "P", lambda: inspector.step_keyframe(-1))
    add("Fly to the selected object", "F", inspector.controls.fly_selected)
    add("Fly to the keyframe", "V", inspector.controls.fly_keyframe)
