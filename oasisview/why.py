"""Why the machine gave an object its label: what it rests on, in one or two plain sentences.

Everything said here is stored with the result; nothing is guessed. Inspectors' own reasons are not here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from oasisview.wording import Limits, length, object_name, percent
from pipeline.result import ChangeLabel, MapObject, MatchCase, Result

# From these on an empty or a different place is named as what speaks for a change.
_EMPTY, _DIFFERENT = 0.3, 0.35
# Moves less likely than this are no rivals worth a word.
_WORTH_A_WORD = 0.02
# Marks that agree in fewer places may agree by chance.
_MARKS = 3


@dataclass(frozen=True)
class Rivals:
    """What else an object could have been.

    Attributes:
        match: the object of the other visit that its patches match best, chosen or not; None without any.
        moved_to: another object that it may have become, or been, elsewhere, by laying both over each other;
            None without any.
        marks: places of the surface whose print or marks agree between where it was and where it is now.
        moved_chance: how likely that is; chosen_chance: of the move that was chosen, if there is one.
    """

    match: int | None = None
    moved_to: int | None = None
    moved_chance: float = 0.0
    chosen_chance: float | None = None
    marks: int = 0


def rivals_of(result: Result, item: MapObject) -> Rivals:
    """The rivals of an object as the result stores them; none for what people corrected."""
    machine: Result = getattr(result, "machine", result)
    try:
        if machine.object(item.object_id).sightings != item.sightings:
            return Rivals()
    except KeyError:
        return Rivals()
    matrix = machine.score_matrix
    is_before = item.sighting(0) is not None
    ids = matrix.column_object_ids if is_before else matrix.row_object_ids
    instance = item.counterpart_instance
    match = int(ids[instance]) if instance is not None and 0 <= instance < len(ids) else None
    moves = getattr(machine, "moves", None)
    best, chosen, other, marks = -math.inf, None, None, 0
    for row in moves if moves is not None else ():
        ends = (int(row["previous_object_id"]), int(row["current_object_id"]))
        if item.object_id not in ends:
            continue
        log_odds = float(row["log_odds"])
        if ends[0] == ends[1]:
            chosen = _chance(log_odds)
            marks = round(math.expm1(float(row["print"]))) if "print" in row.dtype.names else 0
        elif log_odds > best:
            best, other = log_odds, ends[1] if ends[0] == item.object_id else ends[0]
    return Rivals(match, other, _chance(best) if other is not None else 0.0, chosen, marks)


def _chance(log_odds: float) -> float:
    return 1 / (1 + math.exp(-max(min(log_odds, 30.0), -30.0)))


def why(item: MapObject, limits: Limits, rivals: Rivals | None = None) -> str:
    """Why the machine gave this object its label; ``rivals`` adds what else it could have been."""
    if limits.method != "oasis":
        return (
            f"The baseline {limits.method} says so. It does not decide by the patch matches shown here: "
            "they are what the images say."
        )
    rivals = rivals or Rivals()
    match item.label:
        case ChangeLabel.STATIC:
            return _static(item)
        case ChangeLabel.MOVED:
            return _moved(item, limits, rivals)
        case ChangeLabel.APPEARED:
            return _one_sided(item, limits, rivals, appeared=True)
        case ChangeLabel.DISAPPEARED:
            return _one_sided(item, limits, rivals, appeared=False)
        case _:
            return _unknown(item, limits)


def _match_words(item: MapObject) -> str:
    if item.sigma <= 0:
        return "no patch of it finds a match there"
    return f"{percent(item.sigma)} of its patches match, with quality {item.s_bar:.2f}"


def _emptied(item: MapObject) -> str:
    if item.seen_through < 0.005:
        return "none of its volume was seen to be empty on the other visit"
    return f"only {percent(item.seen_through)} of its volume was seen to be empty on the other visit"


def _static(item: MapObject) -> str:
    if len(item.sightings) < 2:
        visit = "earlier" if item.sightings and item.sightings[0].session == 0 else "later"
        made_out = f"Made out as an object on the {visit} visit only"
        return f"{made_out}, but its place did not change: {_emptied(item)}."
    place = ""
    if item.displacement_m is not None:
        place = f", within {length(max(item.displacement_m, 0.01))} of where it was"
    if item.case is MatchCase.CONFIDENT:
        return f"Same object, same place: {_match_words(item)}{place}."
    return (
        f"Same place, nothing changed there{place}: {_emptied(item)}. "
        f"The match alone would not be enough ({_match_words(item)})."
    )


def _moved(item: MapObject, limits: Limits, rivals: Rivals) -> str:
    away = "another place" if item.displacement_m is None else f"{length(item.displacement_m)} away"
    if item.T_world_motion is not None:
        links = "patch by patch nothing links the two" if item.sigma <= 0 else _match_words(item)
        marks = ""
        if rivals.marks >= _MARKS:
            marks = f"; marks on its surface agree in {rivals.marks} places"
        return (
            f"Found again {away}: laid over what stands there, its shape, colours and pattern fit "
            f"({percent(item.confidence)} sure){marks}; {links}.{_next_best(rivals)}"
        )
    if item.case is not MatchCase.CONFIDENT:
        return (
            f"Probably the same object in a new place, {away}, but look twice: its patches alone do not "
            f"show it ({_match_words(item)})."
        )
    return (
        f"Same object, new place: {_match_words(item)}, but it now stands {away} "
        f"(up to {length(limits.tau_d_m)} counts as in place)."
    )


def _next_best(rivals: Rivals) -> str:
    if rivals.moved_to is None or rivals.moved_chance < _WORTH_A_WORD:
        return ""
    against = "" if rivals.chosen_chance is None else f" against {percent(rivals.chosen_chance)} for this one"
    return f" Next best: {object_name(rivals.moved_to)} ({percent(rivals.moved_chance)}{against})."


def _one_sided(item: MapObject, limits: Limits, rivals: Rivals, *, appeared: bool) -> str:
    visit, then = ("earlier", "then") if appeared else ("later", "by then")
    text = f"{percent(item.coverage)} of its place was in view on the {visit} visit"
    if item.seen_through >= _EMPTY:
        text += f", {percent(item.seen_through)} of that was empty {then}"
    elif item.appearance_change is not None and item.appearance_change >= _DIFFERENT:
        text += f", it looked {percent(item.appearance_change)} different {then}"
    text += f", and {_unmatched(item, limits, rivals)}."
    text = text[0].upper() + text[1:]
    if rivals.moved_to is not None and rivals.moved_chance >= _WORTH_A_WORD:
        text += (
            f" Laid over other objects, it fits {object_name(rivals.moved_to)} best "
            f"({percent(rivals.moved_chance)} likely the same{_not_taken(rivals, limits)})."
        )
    if item.replaces is not None:
        text += f" It stands where {object_name(item.replaces)} was."
    if item.replaced_by is not None:
        text += f" {object_name(item.replaced_by).capitalize()} stands there now."
    return text


def _not_taken(rivals: Rivals, limits: Limits) -> str:
    if rivals.moved_chance <= limits.move_chance:
        return f"; {percent(limits.move_chance)} needed"
    return ", but it would hardly have moved, or others fit better"


def _unmatched(item: MapObject, limits: Limits, rivals: Rivals) -> str:
    if item.sigma <= 0:
        return "nothing matched it"
    rival = object_name(rivals.match) if rivals.match is not None else "another object"
    numbers = f"{percent(item.sigma)} of its patches, quality {item.s_bar:.2f}"
    if item.sigma >= limits.tau_sigma and item.s_bar >= limits.tau_s:
        return f"{rival}, which looks like it ({numbers}), is not it"
    return f"nothing matched it well enough; closest is {rival} ({numbers})"


def _unknown(item: MapObject, limits: Limits) -> str:
    other = "earlier" if item.sighting(0) is None else "later"
    maybe = "have been there already" if other == "earlier" else "still be there"
    if item.coverage < 0.005:
        return f"Nobody looked at this place on the {other} visit: it may {maybe}, or not."
    if item.coverage < limits.nu_min:
        return (
            f"Only {percent(item.coverage)} of this place was looked at on the {other} visit; "
            f"{percent(limits.nu_min)} are needed. It may {maybe}."
        )
    if item.case is MatchCase.PARTIAL:
        return (
            f"Not enough to decide. What matches is convincing (quality {item.s_bar:.2f}), but only "
            f"{percent(item.sigma)} of its patches do; {percent(limits.tau_sigma)} are needed. "
            "It was probably seen only in part."
        )
    if item.case is MatchCase.LOOKALIKE:
        return (
            f"Not enough to decide. Something alike is there ({percent(item.sigma)} of the patches match), "
            f"but the quality of {item.s_bar:.2f} is below {limits.tau_s:.2f}, and its place is not "
            "clearly changed either."
        )
    return f"Not enough to decide: {_match_words(item)}, and {_emptied(item)}."
