from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import Any

import numpy as np
import pytest
import viser
from browser_harness import Tabs, ViewerPage, connected
from PIL import Image
from playwright.sync_api import Page

from oasisview import events
from oasisview.access import GuardedServer
from oasisview.assets import Asset, AssetTable
from oasisview.shell import Shell, escape
from pipeline.errors import InputError


def picture(colour: str, width: int = 80, height: int = 60) -> Asset:
    encoded = BytesIO()
    Image.new("RGB", (width, height), colour).save(encoded, "PNG")
    return Asset("image/png", encoded.getvalue())


def band(keyframe: int, images: tuple[str, str] = ("red", "blue")) -> str:
    return (
        f'<input type="range" data-part="slider" data-send="scrub" min="0" max="40" value="{keyframe}">'
        f'<b data-part="title">kf {keyframe}</b>'
        + "".join(
            f'<div data-part="image{k}" data-pixel="pixel" data-session="{k}" '
            f'data-keyframe="{keyframe}" style="width:200px;height:100px;float:left">'
            f'<img src="/asset/{name}" style="width:100%;height:100%;object-fit:contain"></div>'
            for k, name in enumerate(images)
        )
    )


class Bench:
    """A server whose tabs each get a shell that records its events."""

    def __init__(self, server: GuardedServer) -> None:
        self.server = server
        self.shells: dict[int, Shell] = {}
        self.events: list[tuple[str, Any]] = []

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            shell = Shell(client, server)
            for kind, parse in {
                "hello": events.hello,
                "pick": events.object_id,
                "scrub": events.whole_number(0, 40),
                "layer": events.record(key=events.choice("boxes"), value=events.flag),
                "note": events.text(),
                "reason": events.text(),
                "no_reason": events.nothing,
                "pixel": events.pixel_click,
                "swipe": events.nothing,
                "overview": events.nothing,
                "undo": events.nothing,
                "accept": events.nothing,
                "marker": events.whole_number(0, 9),
            }.items():
                shell.on_event(kind, lambda value, kind=kind: self.events.append((kind, value)), parse)
            self.shells[client.client_id] = shell

    def of_kind(self, kind: str) -> list[Any]:
        return [value for known, value in self.events if known == kind]


@pytest.fixture(scope="module")
def shared_bench() -> Iterator[Bench]:
    table = AssetTable()
    for name in ("red", "blue", "green"):
        table.register(name, lambda name=name: picture(name))
    server = GuardedServer(port=0, assets=table)
    yield Bench(server)
    server.stop()


@pytest.fixture(scope="module")
def shared_tab(shared_bench: Bench, shared_tabs: Tabs) -> ViewerPage:
    opened = connected(shared_bench.server, shared_tabs.open(shared_bench.server.url), set())
    opened.wait_shell()
    opened.wait_for(lambda: shared_bench.of_kind("hello"), "the page to say hello")
    return opened


@pytest.fixture
def bench(shared_bench: Bench) -> Bench:
    """The server of the module, with no events yet."""
    shared_bench.events.clear()
    return shared_bench


@pytest.fixture
def tab(bench: Bench, shared_tab: ViewerPage, chromium_page: Callable[..., Page]) -> ViewerPage:
    """The tab of the module, emptied of what an earlier test left."""
    shell = shell_of(bench, shared_tab)
    shared_tab.page.keyboard.press("Escape")
    for region in ("band", "hud", "legend", "who"):
        shell.set_html(region, "")
    shell.set_selection(None)
    shell.set_theme(False)
    shared_tab.page.evaluate(
        "() => { document.querySelectorAll('dialog').forEach(d => d.remove());"
        " document.querySelector('#oa-toast')?.classList.remove('oa-shown'); O('marker', 0); }"
    )
    shared_tab.wait_for(lambda: bench.of_kind("marker"), "what is still on its way")
    shared_tab.wait_js("() => !document.querySelector('#oa-band > *')")
    bench.events.clear()
    return shared_tab


@pytest.fixture
def own_tab(bench: Bench, open_viewer: Callable[..., ViewerPage]) -> ViewerPage:
    """A new tab, for what would not leave the module's as it was."""
    opened = open_viewer(bench.server, size=(1000, 700))
    opened.wait_shell()
    opened.wait_for(lambda: bench.of_kind("hello"), "the page to say hello")
    return opened


def shell_of(bench: Bench, tab: ViewerPage) -> Shell:
    return bench.shells[tab.client.client_id]


def test_events_arrive_checked_and_in_order(bench: Bench, tab: ViewerPage) -> None:
    tab.page.evaluate(
        "() => { for (let i = 1; i <= 60; i++) O('pick', i);"
        " O('pick', 'drop me'); O('never registered', 1); O('pick', 2.5); O('pick', 61); }"
    )
    tab.wait_for(lambda: 61 in bench.of_kind("pick"), "the last event")
    assert bench.of_kind("pick") == list(range(1, 62))


def test_elements_send_without_scripts_of_their_own(bench: Bench, tab: ViewerPage) -> None:
    shell_of(bench, tab).set_html(
        "hud",
        '<button id="pick" data-send="pick" data-value="7">Pick</button>'
        '<input id="boxes" type="checkbox" data-send="layer" data-key="boxes">'
        '<div id="row" tabindex="0" role="button" data-send="pick" data-value="8">row</div>'
        '<button data-accept data-send="accept">Accept</button>',
    )
    tab.page.click("#pick")
    tab.page.check("#boxes")
    tab.page.focus("#row")
    tab.page.keyboard.press("Enter")
    tab.wait_for(lambda: bench.of_kind("pick") == [7, 8], "both picks")
    tab.wait_for(lambda: bench.of_kind("layer") == [{"key": "boxes", "value": True}], "the checkbox")
    tab.page.evaluate("() => document.activeElement.blur()")
    tab.page.keyboard.press("Enter")
    tab.wait_for(lambda: bench.of_kind("accept") == [None], "Enter to press accept")


def test_a_click_in_a_picture_gives_its_place(bench: Bench, tab: ViewerPage) -> None:
    shell_of(bench, tab).set_html("band", band(12))
    # 80 x 60 inside 200 x 100 is shown as 133.3 x 100, centred: u = 0.25 lies 33.3 + 33.3 px from the left.
    tab.wait_js(
        "() => [...document.querySelectorAll('#oa-band img')].filter(i => i.naturalWidth).length === 2"
    )
    box = tab.page.locator("[data-part=image1]").bounding_box()
    assert box is not None
    tab.page.mouse.click(box["x"] + 66.7, box["y"] + 75)
    tab.page.mouse.click(box["x"] + 5, box["y"] + 50)  # beside the picture
    click = tab.wait_for(lambda: bench.of_kind("pixel"), "the click")[0]
    assert (click.session, click.keyframe) == (1, 12)
    assert (click.u, click.v) == (pytest.approx(0.25, abs=0.01), pytest.approx(0.75, abs=0.01))
    tab.page.evaluate("() => O('pick', 1)")
    tab.wait_for(lambda: bench.of_kind("pick"), "a later event")
    assert len(bench.of_kind("pixel")) == 1


def test_the_band_takes_room_from_the_3d_view(bench: Bench, open_viewer: Callable[..., ViewerPage]) -> None:
    for size, height in (((1366, 768), 214), ((1920, 1080), 300)):
        opened = open_viewer(bench.server, size=size)
        opened.wait_shell()
        shell = shell_of(bench, opened)
        shell.set_html("band", band(0))
        opened.wait_js("height => window.__viserMutable.canvas.clientHeight === height", size[1] - height)
        box = opened.page.locator("#oa-band").bounding_box()
        left, top, width, view_height = opened.view_rect()
        assert box is not None and abs(box["height"] - height) <= 1
        assert (box["x"], box["width"]) == (pytest.approx(left, abs=1), pytest.approx(width, abs=1))
        assert box["y"] == pytest.approx(top + view_height, abs=1)
        shell.set_html("band", "")
        opened.wait_js("height => window.__viserMutable.canvas.clientHeight === height", size[1])
        opened.page.close()


def test_band_swaps_in_place_and_leaves_the_slider_in_use_alone(bench: Bench, tab: ViewerPage) -> None:
    shell = shell_of(bench, tab)
    shell.set_html("band", band(3))
    tab.wait_js("() => !!document.querySelector('#oa-band input')")
    tab.page.evaluate("() => { window.kept = document.querySelector('#oa-band input'); kept.focus(); }")
    tab.page.evaluate("() => { kept.value = 9; }")
    shell.swap_band(band(5, ("green", "blue")))
    tab.wait_js("() => document.querySelector('[data-part=title]').textContent === 'kf 5'")
    state = tab.page.evaluate(
        "() => ({same: document.querySelector('#oa-band input') === kept, value: kept.value,"
        " sources: [...document.querySelectorAll('#oa-band img')].map(i => i.getAttribute('src')),"
        " decoded: [...document.querySelectorAll('#oa-band img')].every(i => i.complete && i.naturalWidth)})"
    )
    assert state == {
        "same": True,
        "value": "9",
        "sources": ["/asset/green", "/asset/blue"],
        "decoded": True,
    }
    tab.page.evaluate("() => kept.blur()")
    shell.swap_band(band(6))
    tab.wait_js("() => kept.value === '6' && kept.isConnected")
    shell.swap_band('<b data-part="other">quite another band</b>')
    tab.wait_js("() => document.querySelector('#oa-band').textContent === 'quite another band'")


def test_dragging_the_slider_ends_on_its_value(bench: Bench, tab: ViewerPage) -> None:
    shell_of(bench, tab).set_html("band", band(0))
    tab.page.locator("#oa-band input").focus()
    for _ in range(25):
        tab.page.keyboard.press("ArrowRight")
    tab.wait_for(lambda: bench.of_kind("scrub")[-1:] == [25], "the last value of the slider")
    assert bench.of_kind("scrub") == sorted(bench.of_kind("scrub"))


def test_selection_is_marked_and_kept_in_the_address(
    bench: Bench, tab: ViewerPage, open_viewer: Callable[..., ViewerPage]
) -> None:
    shell = shell_of(bench, tab)
    shell.set_html("legend", '<p id="a" data-object="3">3</p><p id="b" data-object="33">33</p>')
    shell.set_selection(33)
    tab.wait_js("() => new URLSearchParams(location.search).get('object') === '33'")
    outlines = "() => ['a', 'b'].map(id => getComputedStyle(document.getElementById(id)).outlineStyle)"
    assert tab.page.evaluate(outlines) == ["none", "solid"]
    shell.set_selection(None)
    tab.wait_js("() => !new URLSearchParams(location.search).has('object')")
    assert tab.page.evaluate(outlines) == ["none", "none"]

    linked = open_viewer(bench.server, query="?object=12", size=(1000, 700))
    linked.wait_for(lambda: bench.of_kind("hello"), "the linked page to say hello")
    assert bench.of_kind("hello")[0] == events.Hello(object_id=12, width_px=1000, height_px=700)


def test_theme_changes_the_palette(bench: Bench, tab: ViewerPage) -> None:
    colour = "name => getComputedStyle(document.documentElement).getPropertyValue(name).trim()"
    assert tab.page.evaluate(colour, "--oa-moved") == "#c47514"
    shell_of(bench, tab).set_theme(True)
    tab.wait_js(f"() => ({colour})('--oa-moved') === '#f2db83'")
    shell_of(bench, tab).set_theme(False)
    tab.wait_js(f"() => ({colour})('--oa-moved') === '#c47514'")


def test_what_others_wrote_stays_text(bench: Bench, tab: ViewerPage) -> None:
    hostile = '</b><img src=x onerror="window.hacked=1"><script>window.hacked=1</script>\'"&'
    shell = shell_of(bench, tab)
    shell.set_html("who", f'<b id="name" title="{escape(hostile)}">{escape(hostile)}</b>')
    shell.toast(hostile)
    shell.ask_reason(hostile, hostile)
    tab.page.wait_for_selector("#oa-ask[open]")
    shown = tab.page.evaluate(
        "() => [document.querySelector('#name').textContent, document.querySelector('#name').title,"
        " document.querySelector('#oa-toast').textContent, document.querySelector('#oa-ask h2').textContent,"
        " document.querySelector('#oa-ask p').textContent]"
    )
    assert shown == [hostile] * 5
    tab.settle()
    assert not tab.page.evaluate("() => 'hacked' in window")


def test_keys_of_the_shell_and_of_viser_stay_out_of_dialogs(bench: Bench, own_tab: ViewerPage) -> None:
    shell = shell_of(bench, own_tab)
    shell.add_command("Label static", "1", lambda: bench.events.append(("command", 1)))
    own_tab.page.keyboard.press("x")
    own_tab.page.keyboard.press("h")
    own_tab.wait_for(lambda: bench.of_kind("swipe") and bench.of_kind("overview"), "the keys of the shell")

    def command_fired() -> bool:
        own_tab.page.keyboard.press("1")
        return bool(bench.of_kind("command"))

    own_tab.wait_for(command_fired, "the command of viser")
    own_tab.settle()
    own_tab.page.evaluate("() => O('pick', 1)")  # whatever is still on its way comes before this
    own_tab.wait_for(lambda: bench.of_kind("pick"), "a marker")
    fired = len(bench.of_kind("command"))

    own_tab.page.keyboard.press("m")
    own_tab.page.wait_for_selector("#oa-ask[open]")
    own_tab.page.keyboard.type("check 1 box, x h m ?")
    own_tab.page.keyboard.press("Control+Enter")
    own_tab.wait_for(lambda: bench.of_kind("note") == ["check 1 box, x h m ?"], "the note")
    own_tab.page.keyboard.press("m")
    own_tab.page.keyboard.press("Escape")
    own_tab.wait_js("() => !document.querySelector('dialog[open]')")

    own_tab.page.keyboard.press("?")
    own_tab.page.wait_for_selector("#oa-help[open]")
    assert "Label static" in own_tab.page.inner_text("#oa-help")
    own_tab.page.keyboard.press("1")
    own_tab.page.keyboard.press("x")
    own_tab.page.keyboard.press("Escape")
    own_tab.wait_js("() => !document.querySelector('dialog[open]')")
    own_tab.page.evaluate("() => O('pick', 2)")
    own_tab.wait_for(lambda: 2 in bench.of_kind("pick"), "a marker")
    assert len(bench.of_kind("command")) == fired
    assert (len(bench.of_kind("swipe")), len(bench.of_kind("note"))) == (1, 1)


def test_a_reason_is_written_or_declined_never_forgotten(bench: Bench, tab: ViewerPage) -> None:
    shell = shell_of(bench, tab)
    shell.ask_reason("Why?", "It is kept.")
    tab.page.wait_for_selector("#oa-ask[open]")
    assert tab.page.get_by_role("button", name="Save").is_disabled()
    tab.page.keyboard.type("   ")
    tab.page.keyboard.press("Control+Enter")
    assert tab.page.locator("#oa-ask[open]").count() == 1, "blanks are no reason"
    tab.page.keyboard.type("it moved")
    tab.page.get_by_role("button", name="Save").click()
    tab.wait_for(lambda: bench.of_kind("reason") == ["it moved"], "the reason")
    shell.ask_reason("Why?", "It is kept.")
    tab.page.get_by_role("button", name="No reason").click()
    tab.wait_for(lambda: bench.of_kind("no_reason") == [None], "the refusal to say why")
    tab.wait_js("() => !document.querySelector('dialog[open]')")
    assert bench.of_kind("reason") == ["it moved"]


def test_tastes_stay_in_the_browser_and_places_in_the_address(bench: Bench, own_tab: ViewerPage) -> None:
    shell = shell_of(bench, own_tab)
    shell.remember({"dark": True})
    shell.set_address(keyframe="2.3", map="both")
    own_tab.wait_js("() => location.search.includes('keyframe=2.3') && location.search.includes('map=both')")
    own_tab.page.reload()
    own_tab.wait_for(lambda: len(bench.of_kind("hello")) == 2, "the page to come back")
    hello = bench.of_kind("hello")[1]
    assert hello.remembered == {"dark": True}
    assert hello.address == {"keyframe": "2.3", "map": "both"}
    bench.shells[max(bench.shells)].set_address(map=None)
    own_tab.wait_js("() => !location.search.includes('map=')")


def test_toast_offers_undo(bench: Bench, tab: ViewerPage) -> None:
    shell_of(bench, tab).toast("Set to static", undo=True)
    tab.page.click("#oa-toast.oa-shown button")
    tab.wait_for(lambda: bench.of_kind("undo"), "undo")


def test_the_camera_flies_and_a_click_still_hits(bench: Bench, own_tab: ViewerPage) -> None:
    clicked = threading.Event()
    box = bench.server.scene.add_box("/box", dimensions=(0.5, 0.5, 0.5), position=(2.0, 1.0, 0.5))
    box.on_click(lambda _: clicked.set())
    shell = shell_of(bench, own_tab)
    shell.set_html("band", band(0))
    own_tab.wait_node("/box")
    shell.fly_to((2.0, -2.0, 2.0), (2.0, 1.0, 0.5))
    own_tab.wait_for(
        lambda: (
            np.allclose(own_tab.client.camera.position, (2.0, -2.0, 2.0), atol=0.02)
            and np.allclose(own_tab.client.camera.look_at, (2.0, 1.0, 0.5), atol=0.02)
        ),
        "the camera to arrive",
    )
    own_tab.settle()
    own_tab.click_world((2.0, 1.0, 0.5))
    own_tab.wait_for(clicked.is_set, "the click on the box")
    for bad in ((0, 0), (0, np.nan, 0), (2.0, 1.0, 0.5)):
        with pytest.raises(ValueError):
            shell.fly_to(bad, (2.0, 1.0, 0.5))


def test_each_tab_has_its_own_page(
    bench: Bench, tab: ViewerPage, open_viewer: Callable[..., ViewerPage]
) -> None:
    other = open_viewer(bench.server)
    other.wait_shell()
    shell_of(bench, other).set_html("who", "only for the second")
    other.wait_js("() => document.querySelector('#oa-who').textContent === 'only for the second'")
    assert tab.page.inner_text("#oa-who") == ""
    scripts = [
        message
        for message in bench.server._websock_server._broadcast_buffer.message_from_id.values()
        if type(message).__name__ == "RunJavascriptMessage"
    ]
    assert scripts == [], "viser would replay scripts of the server's scope to everybody who comes later"


def test_a_reconnected_page_works_on(
    guarded_server: Callable[..., GuardedServer], open_viewer: Callable[..., ViewerPage]
) -> None:
    bench = Bench(guarded_server())
    tab = open_viewer(bench.server, size=(1000, 700))
    tab.wait_for(lambda: bench.of_kind("hello"), "the page to say hello")
    bench.server._websock_server.disconnect_all_clients()
    tab.wait_for(lambda: len(bench.of_kind("hello")) == 2, "the page to come back")
    newest = bench.shells[max(bench.shells)]
    newest.set_html("who", "back")
    tab.wait_js("() => document.querySelector('#oa-who').textContent === 'back'")
    tab.page.evaluate("() => O('pick', 5)")
    tab.wait_for(lambda: bench.of_kind("pick") == [5], "an event over the new connection")


def test_a_failing_handler_is_reported_and_the_next_event_handled(bench: Bench, own_tab: ViewerPage) -> None:
    def refuse(_: int) -> None:
        raise InputError("object 3 is locked", "ask ana")

    shell = shell_of(bench, own_tab)
    shell.on_event("pick", refuse, events.object_id)
    own_tab.page.evaluate("() => { O('pick', 3); O('swipe'); }")
    own_tab.wait_for(lambda: bench.of_kind("swipe"), "the event after the failure")
    own_tab.wait_js(
        "() => document.querySelector('#oa-toast')?.textContent === 'object 3 is locked: ask ana'"
    )


def test_without_scripts_the_panels_still_work(
    guarded_server: Callable[..., GuardedServer],
    open_viewer: Callable[..., ViewerPage],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Shell, "available", staticmethod(lambda: False))
    bench = Bench(guarded_server())
    opened = open_viewer(bench.server)
    shell = opened.wait_for(lambda: bench.shells.get(opened.client.client_id), "the shell")
    shell.set_html("band", "<b>nothing to see</b>")
    shell.swap_band("<b>nothing to see</b>")
    shell.set_selection(3)
    shell.toast("Saved")
    opened.page.get_by_text("Saved").wait_for()
    shell.fly_to((3.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    opened.wait_for(lambda: np.allclose(opened.client.camera.position, (3, 0, 1), atol=0.02), "the jump")

    def swiped() -> bool:
        opened.page.keyboard.press("x")
        return bool(bench.of_kind("swipe"))

    opened.wait_for(swiped, "X as a command of viser")
    assert not opened.page.evaluate("() => 'oasis' in window || !!document.getElementById('oa-band')")
