"""The end of the report: every decision, and how the machine came to its labels."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from oasisview import wording
from oasisview.correction_words import event_words
from oasisview.export.exporter import ReviewedResult
from oasisview.export.report_words import count, moment
from oasisview.review import Event
from oasisview.shell import escape
from oasisview.wording import Limits
from pipeline.settings import Settings


def decisions(reviewed: ReviewedResult) -> str:
    """The journal, oldest first: nothing that anybody did is left out."""
    if not reviewed.events:
        return "<section><h2>Decisions</h2><p>Nobody has decided anything yet.</p></section>\n"
    rows = "".join(_decision(event, reviewed) for event in reviewed.events)
    head = "".join(f"<th>{name}</th>" for name in ("when", "who", "object", "what", "why"))
    return (
        '<section><h2>Decisions</h2><p class="small">The whole journal, oldest first; what was taken back is '
        "an entry too.</p>"
        f'<table class="list"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></section>\n'
    )


def _decision(event: Event, reviewed: ReviewedResult) -> str:
    target = reviewed.events[event.target_id - 1] if event.target_id else None
    what = event_words(event, reviewed.corrected.machine, target)
    number = f"#{event.object_id}" if event.object_id else "all"
    cells = (moment(event.at), event.who, number, what, event.why)
    return f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>\n"


def method(reviewed: ReviewedResult) -> str:
    """Recordings, limits, settings and versions."""
    result = reviewed.result
    manifest, limits = result.manifest, Limits.of(result)
    parts = [
        "<section><h2>How this came about</h2>",
        _table("Recordings", ("", "name", "captured", "frames", "used", "format"), _recordings(reviewed)),
        _table("Limits", ("limit", "value", "meaning"), _limits(limits)),
    ]
    changed = list(_changed_settings(manifest.get("settings", {})))
    if changed:
        rows: list[tuple[str, ...]] = [
            (name, _plain(value), _plain(default)) for name, value, default in changed
        ]
        parts.append(
            _table(
                "Settings that differ from the defaults of the version that wrote this page",
                ("setting", "value", "default"),
                rows,
            )
        )
    else:
        parts.append(
            '<p class="small">All settings are the defaults of the version that wrote this page.</p>'
        )
    versions = manifest.get("versions", {})
    said = ", ".join(f"{name} {version}" for name, version in sorted(versions.items()))
    seconds = sum(manifest.get("timings_s", {}).values())
    parts.append(
        f'<p class="small"><b>Versions:</b> {escape(said)}. <b>Computed in</b> '
        f"{wording.duration(seconds)}. <b>Key of the result:</b> "
        f"<code>{escape(manifest.get('key', ''))}</code>.</p>"
    )
    warnings = [str(warning) for warning in manifest.get("warnings", [])]
    if warnings:
        listed = "".join(f"<li>{escape(warning)}</li>" for warning in warnings)
        parts.append(f'<h3>Warnings of the run</h3><ul class="small">{listed}</ul>')
    everything = escape(json.dumps(manifest.get("settings", {}), indent=1, sort_keys=True))
    parts.append(
        "<details><summary>All settings (on paper only if opened before printing)</summary>"
        f"<pre>{everything}</pre></details></section>\n"
    )
    return "".join(parts)


def _recordings(reviewed: ReviewedResult) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for session, source in zip(
        reviewed.result.sessions, reviewed.result.manifest.get("inputs", ()), strict=False
    ):
        rows.append(
            (
                wording.visit_word(session.index, len(reviewed.result.sessions)),
                session.name,
                moment(session.captured_at),
                str(source.get("frames", "")),
                count(len(session.keyframes), "keyframe"),
                str(source.get("format", "")),
            )
        )
    return rows


def _limits(limits: Limits) -> list[tuple[str, ...]]:
    return [
        (
            "\u03c4\u03c3",
            wording.percent(limits.tau_sigma),
            "least share of an object's patches that have to match",
        ),
        ("\u03c4s", f"{limits.tau_s:.2f}", "least quality of those matches, 0 to 1"),
        (
            "\u03c4d",
            f"{limits.tau_d_m:.2f} m",
            "farthest that an object may be off and still count as in place",
        ),
        (
            "\u03bdmin",
            wording.percent(limits.nu_min),
            "least share of a place that the other visit must have seen",
        ),
    ]


def _changed_settings(settings: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    defaults = Settings().to_dict()
    for section, values in settings.items():
        for name, value in values.items():
            default = defaults.get(section, {}).get(name)
            if value != default:
                yield f"{section}.{name}", value, default


def _plain(value: Any) -> str:
    return "\u2013" if value is None else str(value)


def _table(title: str, head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    columns = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return (
        f'<h3>{escape(title)}</h3><table class="list"><thead><tr>{columns}</tr></thead>'
        f"<tbody>{body}</tbody></table>"
    )
