"""What the viewer says about an object, in words an inspector uses: plain text, never markup.

One place for all of it, so that the queue, the evidence and the journal say the same thing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.result import ChangeLabel, MapObject, MatchCase, Result
from pipeline.settings import Settings

LABEL_WORDS: dict[ChangeLabel, str] = {
    ChangeLabel.STATIC: "same",
    ChangeLabel.APPEARED: "new",
    ChangeLabel.DISAPPEARED: "gone",
    ChangeLabel.MOVED: "moved",
    ChangeLabel.UNKNOWN: "unknown",
}
LABEL_NAMES: dict[ChangeLabel, str] = {label: label.name.lower() for label in ChangeLabel}
LABEL_OF_NAME: dict[str, ChangeLabel] = {name: label for label, name in LABEL_NAMES.items()}
CASE_WORDS: dict[MatchCase, str] = {
    MatchCase.CONFIDENT: "case 1: sure match",
    MatchCase.PARTIAL: "case 2: seen in part",
    MatchCase.LOOKALIKE: "case 3: looks alike, is not",
    MatchCase.NONE: "case 4: no match",
}
LINK_ROLES: dict[str, str] = {
    "match": "best match of the patch",
    "rival": "a rival: it claims the patch too",
    "object": "a patch of the selected object and its best match",
}
NOT_COMPARED = "These two keyframes were not compared patch by patch."
NOTHING_SELECTED = (
    "Click an object in the map, in an image or in the queue, or press J for the most doubtful one."
)
NO_REASON = "(no reason given)"  # stored in the place of a reason: silence was chosen, not forgotten
REASON_HINT = "Your reason is kept with your name and the time, and goes into the exports."
NO_DECISIONS = "No decisions yet. Press Enter to accept a label, or 1 to 5 to set another one."
NO_SHARED_VIEW = "No keyframe of the other visit shows this view."
NO_OBJECTS = "No objects were found in these visits, so there is nothing to review."
NO_WHAT_IF = (
    "This result does not hold what its labels follow from, so other limits cannot be tried: it was made by "
    "an earlier version or by a baseline. Process the visits again to try them."
)
NO_OVERLAP = (
    "This result was decided by matches alone: what was seen at each place was not compared. Process the "
    "visits again with --set change.rule=evidence."
)
NOTHING_IN_QUEUE = "Nothing to show: every label is switched off above. Click a label to show it."


@dataclass(frozen=True)
class Limits:
    """The limits a result was decided with, as its manifest stores them.

    Attributes:
        tau_sigma: least share of matching patches; tau_s: least match quality.
        tau_d_m: largest displacement of an object that stayed, metres.
        nu_min: least share of a place that the other visit must have looked at.
        move_chance: least chance that two objects are one that moved.
        method: what decided: this engine or a baseline, which has limits of its own.
    """

    tau_sigma: float
    tau_s: float
    tau_d_m: float
    nu_min: float
    move_chance: float = 0.31
    method: str = "oasis"

    @classmethod
    def of(cls, result: Result) -> Limits:
        """The limits of a result; what an old manifest does not hold takes the documented default."""
        settings = result.manifest.get("settings", {})
        change = settings.get("change", {})
        default = Settings().change
        moves = settings.get("moves", {})
        matrix = result.score_matrix
        return cls(
            tau_sigma=float(matrix.tau_sigma),
            tau_s=float(matrix.tau_s),
            tau_d_m=float(change.get("tau_d_m", default.tau_d_m)),
            nu_min=float(change.get("nu_min", default.nu_min)),
            move_chance=1 / (1 + math.exp(-float(moves.get("min_log_odds", Settings().moves.min_log_odds)))),
            method=str(settings.get("run", {}).get("method", "oasis")),
        )


def pair_case(sigma: float, s_bar: float, limits: Limits) -> MatchCase:
    """Which of the four cases a pair of objects is (paper, Sec. III-C.2)."""
    if s_bar >= limits.tau_s:
        return MatchCase.CONFIDENT if sigma >= limits.tau_sigma else MatchCase.PARTIAL
    return MatchCase.LOOKALIKE if sigma >= limits.tau_sigma else MatchCase.NONE


def visit_word(session: int, sessions: int = 2) -> str:
    """Before / After for a pair of visits; Visit 1, 2, ... for longer series."""
    if sessions > 2:
        return f"Visit {session + 1}"
    return ("Before", "After")[session]


def percent(share: float) -> str:
    """A share in [0, 1] as whole percent."""
    return f"{share:.0%}"


def length(metres: float) -> str:
    """Centimetres below one metre, else metres with two decimals."""
    return f"{metres * 100:.0f} cm" if metres < 1.0 else f"{metres:.2f} m"


def duration(seconds: float) -> str:
    """Seconds, or minutes and seconds from one minute on."""
    whole = round(seconds)
    return f"{whole} s" if whole < 60 else f"{whole // 60} min {whole % 60:02d} s"


def size(extent_m: tuple[float, float, float]) -> str:
    """Side lengths of the bounds, longest first, in one unit."""
    longest_first = sorted(extent_m, reverse=True)
    if longest_first[0] < 1.0:
        return " x ".join(f"{side * 100:.0f}" for side in longest_first) + " cm"
    return " x ".join(f"{side:.2f}" for side in longest_first) + " m"


def place(point_world_m: tuple[float, float, float]) -> str:
    """A place in the world frame, metres to the centimetre."""
    return "x {:.2f}, y {:.2f}, z {:.2f} m".format(*point_world_m)


def object_name(object_id: int) -> str:
    """How an object is called everywhere; embedded perception does not name classes."""
    return f"object #{object_id}"


def queue_fact(item: MapObject, label: ChangeLabel) -> str:
    """The one line under an object in the queue."""
    if label is item.label:
        if item.replaced_by is not None:
            return f"replaced by #{item.replaced_by}"
        if item.replaces is not None:
            return f"replaces #{item.replaces}"
    if label is ChangeLabel.MOVED and item.displacement_m is not None:
        return f"moved {length(item.displacement_m)}"
    return {
        ChangeLabel.STATIC: "in place",
        ChangeLabel.APPEARED: "new here",
        ChangeLabel.DISAPPEARED: "gone",
        ChangeLabel.MOVED: "moved",
        ChangeLabel.UNKNOWN: "not decided",
    }[label]


def overridden(label: ChangeLabel, machine: ChangeLabel, who: str) -> str:
    """The sentence in front of the machine's reasons once an inspector said otherwise."""
    return f"{who} set this to {LABEL_NAMES[label]}; the machine said {LABEL_NAMES[machine]}."


def rejection(
    sigma: float, s_bar: float, limits: Limits, *, partner_id: int | None, partner_sigma: float = 1.0
) -> str:
    """Why a candidate is not the counterpart; ``partner_*`` is the one that was chosen, if any."""
    if s_bar < limits.tau_s <= 1 and sigma >= limits.tau_sigma:
        return (
            f"{percent(sigma)} of the patches land here, but they match poorly "
            f"({s_bar:.2f}, at least {limits.tau_s:.2f} needed)"
        )
    if sigma < limits.tau_sigma:
        return f"only {percent(sigma)} of the patches land here ({percent(limits.tau_sigma)} needed)"
    if partner_id is not None and partner_sigma < sigma:
        return (
            f"matches by itself ({percent(sigma)}, quality {s_bar:.2f}), but over all objects together "
            f"#{partner_id} was the better choice"
        )
    if partner_id is not None:
        return f"matches too ({percent(sigma)}, quality {s_bar:.2f}), but #{partner_id} fits better"
    return (
        f"matches by itself ({percent(sigma)}, quality {s_bar:.2f}), but belongs to another object or place"
    )
