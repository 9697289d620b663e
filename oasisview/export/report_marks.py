"""Signs of labels in the report, as SVG: told apart by shape, pattern and glyph as well as by colour."""

from __future__ import annotations

from oasisview.palette import LIGHT, REPLACED_LIGHT
from oasisview.panels.markup import GLYPHS
from oasisview.wording import LABEL_OF_NAME

COLOURS: dict[str, str] = {name: LIGHT[label] for name, label in LABEL_OF_NAME.items()} | {
    "replaced": REPLACED_LIGHT
}
# Patterns that marks refer to; once in the page, before the first mark.
DEFINITIONS = (
    '<svg width="0" height="0" style="position:absolute" aria-hidden="true"><defs>'
    '<pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    f'<rect width="6" height="6" fill="{COLOURS["unknown"]}"/>'
    '<rect width="2.2" height="6" fill="#2e2f31"/></pattern>'
    '<pattern id="lines" width="7" height="7" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    f'<rect width="2" height="7" fill="{COLOURS["disappeared"]}" fill-opacity=".55"/></pattern>'
    '<pattern id="dots" width="8" height="8" patternUnits="userSpaceOnUse">'
    f'<circle cx="4" cy="4" r="1.8" fill="{COLOURS["unknown"]}" fill-opacity=".7"/></pattern>'
    '<marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="5.5" markerHeight="5.5" '
    f'orient="auto-start-reverse"><path d="M0 0L10 5L0 10Z" fill="{COLOURS["moved"]}"/></marker>'
    "</defs></svg>"
)


def mark(name: str, x: float, y: float, radius: float, text: str) -> str:
    """A label's sign around (x, y), for inside an ``<svg>``; ``text`` is a number or a glyph."""
    fill = "url(#hatch)" if name == "unknown" else COLOURS[name]
    r = radius
    outline = f'fill="{fill}" stroke="#fff" stroke-width="{r * 0.14:.1f}"'
    if name == "appeared":
        shape = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" {outline}/>'
    elif name == "moved":
        shape = (
            f'<path d="M{x - r:.1f} {y - r * 0.86:.1f}H{x + r * 0.5:.1f}L{x + r * 1.2:.1f} {y:.1f}'
            f'L{x + r * 0.5:.1f} {y + r * 0.86:.1f}H{x - r:.1f}Z" {outline}/>'
        )
    else:
        round_corner = {"disappeared": 0.0, "replaced": 0.9}.get(name, 0.45) * r
        shape = (
            f'<rect x="{x - r * 0.9:.1f}" y="{y - r * 0.9:.1f}" width="{r * 1.8:.1f}" height="{r * 1.8:.1f}" '
            f'rx="{round_corner:.1f}" {outline}/>'
        )
    size = r * (1.15 if len(text) < 3 else 0.85)
    halo = ' paint-order="stroke" stroke="#2e2f31" stroke-width="3"' if name == "unknown" else ""
    return f'{shape}<text x="{x:.1f}" y="{y:.1f}" font-size="{size:.1f}" class="in-mark"{halo}>{text}</text>'


def standalone(name: str, text: str | None = None) -> str:
    """The sign by itself, as large as a line of text."""
    inside = mark(name, 13, 12, 10, GLYPHS[name] if text is None else text)
    return f'<svg class="mark" viewBox="0 0 27 24" aria-hidden="true">{inside}</svg>'
