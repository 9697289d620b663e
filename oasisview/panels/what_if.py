"""What-if: sliders for the limits, and what would be labelled otherwise under them.

Two pieces of html: sliders that are replaced while a hand drags them would fall back, so only the outcome
is sent anew with every step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.panels.markup import chip, empty, picture, section, sends
from oasisview.shell import escape
from oasisview.what_if_limits import LIMITS, RULE_TIPS, RULES, Limit, Trial
from oasisview.wording import LABEL_NAMES, LABEL_WORDS
from pipeline.change.relabel import Flip, Relabelled
from pipeline.result import ChangeLabel

SHOWN = 200
_FORMATS = {
    "chance": "this.value+'%'",
    "share": "this.value+'%'",
    "length": "this.value<100?this.value+' cm':(this.value/100).toFixed(2)+' m'",
    "quality": "(this.value/100).toFixed(2)",
}


def controls_html(trial: Trial, *, can_change_rule: bool) -> str:
    """Sliders; those that matter to nothing under the rule are left out, and a line says so."""
    switch = "".join(
        f'<button aria-pressed="{str(trial.rule == rule).lower()}" {sends("what_if_rule", rule)} '
        f'title="{escape(RULE_TIPS[rule])}" {"" if can_change_rule or trial.rule == rule else "disabled"}>'
        f"{escape(name)}</button>"
        for rule, name in RULES.items()
    )
    used = [limit for limit in LIMITS if trial.rule in limit.rules]
    naming = [limit for limit in LIMITS if trial.rule not in limit.rules and limit.names]
    idle = [limit for limit in LIMITS if trial.rule not in limit.rules and not limit.names]
    rest = ""
    if naming:
        sliders = "".join(_slider(trial, limit) for limit in naming)
        rest = section("What a sure match is") + _note("Decides no label under this rule.") + sliders
    if idle:
        rest = _note(f"Not used by this rule: {' and '.join(limit.title for limit in idle)}.")
    return (
        '<div class="oa oa-what-if"><div class="oa-note">Try other limits on the finished map. Nothing is '
        "saved until you apply it.</div>"
        f'{section("Decided by")}<div class="oa-segments" role="group" aria-label="Decided by">{switch}</div>'
        f"{section('Limits')}{''.join(_slider(trial, limit) for limit in used)}{rest}"
        f'<button class="oa-reset" {sends("what_if_reset")} title="Back to the limits of this result">'
        "Reset</button></div>"
    )


def _slider(trial: Trial, limit: Limit) -> str:
    step = trial.step(limit)
    own = limit.step_of(trial.own)
    at = 100 * (own - limit.low) / (limit.high - limit.low)
    symbol = f' <i class="oa-symbol">{limit.symbol}</i>' if limit.symbol else ""
    return (
        f'<label class="oa-limit" title="{escape(limit.tip)}. This result: {escape(limit.words(own))}">'
        f"<span>{escape(limit.title)}{symbol}</span>"
        f'<output data-limit="{limit.key}">{escape(limit.words(step))}</output>'
        f'<span class="oa-limit-track" style="--own:{at:.1f}%">'
        f'<input type="range" min="{limit.low}" max="{limit.high}" value="{step}" '
        f'data-send="what_if_{limit.key}" aria-label="{escape(limit.tip)}" '
        f"oninput=\"this.closest('label').querySelector('output').textContent={_FORMATS[limit.scale]}\">"
        "</span></label>"
    )


def unavailable_html(reason: str) -> str:
    """What stands in the tab where nothing can be tried."""
    return f'<div class="oa oa-what-if">{empty(reason)}</div>'


def outcome_html(
    catalogue: Catalogue,
    trial: Trial,
    relabelled: Relabelled,
    decided: Collection[int],
    applicable: int,
    cases_changed: int,
) -> str:
    """What would be labelled otherwise.

    Args:
        catalogue: for pictures.
        trial: what is tried.
        relabelled: its outcome.
        decided: objects that an inspector decided about, which stay as they are.
        applicable: how many objects would be recorded.
        cases_changed: objects whose best match would be named another of the four cases.
    """
    flips = relabelled.flips
    if not trial.differences:
        return f'<div class="oa oa-what-if">{_note("These are the limits of this result.")}</div>'
    counts = Counter((flip.machine, tuple(dict.fromkeys(flip.labels))) for flip in flips)
    summary = "".join(
        f'<li><span class="oa-flip-sign">{chip(machine)}\u2192{"".join(map(chip, would))}</span>'
        f"{escape(flip_words(machine, would))}<b>{count}</b></li>"
        for (machine, would), count in counts.most_common()
    )
    kept = sum(flip.object_id in decided for flip in flips)
    parted = sum(flip.parts for flip in flips)
    notes = ""
    if kept:
        notes += _note(f"{_count(kept)} of these {'was' if kept == 1 else 'were'} decided by people: kept.")
    if parted:
        notes += _note(f"{_count(parted)} would fall into two: one that was there, one that is there.")
    if cases_changed:
        notes += _note(
            f"{_count(cases_changed)} would have {_its(cases_changed)} best match named otherwise."
        )
    head = f"{len(flips)} of {len(catalogue.objects)} would change" if flips else "No label would change"
    apply = (
        f'<button class="oa-primary oa-apply" {sends("what_if_apply")} '
        f'title="Record this in the journal, as one decision that one undo takes back">'
        f"Apply to {_count(applicable)} \u2026</button>"
        if applicable
        else ""
    )
    rows = "".join(_row(catalogue, flip, flip.object_id in decided) for flip in flips[:SHOWN])
    more = _note(f"{len(flips) - SHOWN} more are not listed.") if len(flips) > SHOWN else ""
    return (
        f'<div class="oa oa-what-if" data-flips="{len(flips)}">'
        f'<div class="oa-section"><span data-role="flips">{escape(head)}</span></div>'
        f'<ul class="oa-flip-counts">{summary}</ul>{notes}{apply}{rows}{more}</div>'
    )


def flip_words(machine: ChangeLabel, would: tuple[ChangeLabel, ...]) -> str:
    """A change of label in words."""
    last = [LABEL_WORDS[label] for label in dict.fromkeys(would)]
    return f"{LABEL_WORDS[machine]} \u2192 {' and '.join(last)}"


def _row(catalogue: Catalogue, flip: Flip, is_decided: bool) -> str:
    name = wording.object_name(flip.object_id)
    fact = flip_words(flip.machine, flip.labels)
    if flip.parts:
        fact += ", as two objects"
    if flip.joins is not None:
        fact += f", one with #{flip.joins}"
    if is_decided:
        fact += " (decided: kept)"
    signs = "".join(chip(label) for label in dict.fromkeys(flip.labels))
    return (
        f'<div class="oa-flip" role="button" tabindex="0" data-object="{flip.object_id}" '
        f'data-flip="{"-".join(LABEL_NAMES[label] for label in flip.labels)}" '
        f'{sends("select", flip.object_id)} title="{escape(name)}: {escape(fact)}">'
        f"{picture(catalogue.thumbnail_url(flip.object_id), name)}"
        f'<span class="oa-flip-sign">{chip(flip.machine)}\u2192{signs}</span>'
        f'<span class="oa-name">#{flip.object_id}<small>{escape(fact)}</small></span></div>'
    )


def _note(text: str) -> str:
    return f'<div class="oa-note">{escape(text)}</div>'


def _count(number: int) -> str:
    return f"{number} object{'' if number == 1 else 's'}"


def _its(number: int) -> str:
    return "its" if number == 1 else "their"
