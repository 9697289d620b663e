"""The limits that a person may try out, in words, and how a slider's whole steps stand for a setting."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from oasisview import wording
from pipeline.settings import Settings

Scale = Literal["chance", "share", "length", "quality"]
RULES: Mapping[str, str] = {"evidence": "each place", "paper": "matches alone"}
RULE_TIPS: Mapping[str, str] = {
    "evidence": "What was seen at each place decides: emptied, filled, looking other; then moves are found",
    "paper": "Patch matches alone decide, as in the paper: what finds no sure partner is gone or new",
}


@dataclass(frozen=True)
class Limit:
    """One slider.

    Attributes:
        key: names it in events; setting: ``section.name`` of the engine's settings.
        title: what it limits, in a few words; symbol: of the paper, or empty; tip: the whole sentence.
        scale: what a step is: ``chance`` and ``share`` percent, ``length`` centimetres, ``quality``
            hundredths. A chance stands for log odds.
        low, high: ends of the slider, in steps.
        rules: the rules of decision that it matters to.
        names: it also says how matches are called (the four cases), whatever decides.
    """

    key: str
    setting: str
    title: str
    symbol: str
    tip: str
    scale: Scale
    low: int
    high: int
    rules: tuple[str, ...]
    names: bool = False

    def step_of(self, settings: Settings) -> int:
        """The step nearest to a setting, within the slider."""
        section, _, name = self.setting.partition(".")
        value = float(getattr(getattr(settings, section), name))
        if self.scale == "chance":
            value = 1 / (1 + math.exp(-value))
        return min(max(round(100 * value), self.low), self.high)

    def value_of(self, step: int) -> float:
        """What the setting is at a step."""
        share = step / 100
        return math.log(share / (1 - share)) if self.scale == "chance" else share

    def words(self, step: int) -> str:
        """A step as people read it."""
        if self.scale == "length":
            return wording.length(step / 100)
        return f"{step / 100:.2f}" if self.scale == "quality" else f"{step}%"


LIMITS: tuple[Limit, ...] = (
    Limit(
        "change", "change.min_log_odds", "place changed", "",
        "A place counts as changed when what was seen there makes that at least this likely",
        "chance", 5, 99, ("evidence",),
    ),
    Limit(
        "move", "moves.min_log_odds", "moved here", "",
        "Two objects count as one that moved when that is at least this likely",
        "chance", 2, 98, ("evidence",),
    ),
    Limit(
        "nu_min", "change.nu_min", "place looked at", "\u03bd",
        "Unknown stays what the other visit looked at less than this share of",
        "share", 0, 100, ("evidence", "paper"),
    ),
    Limit(
        "tau_d", "change.tau_d_m", "displacement", "d",
        "Up to this far from where it was, an object counts as in place",
        "length", 0, 200, ("evidence", "paper"),
    ),
    Limit(
        "tau_sigma", "association.tau_sigma", "matching patches", "\u03c3",
        "A sure match needs at least this share of an object's patches",
        "share", 0, 100, ("paper",), names=True,
    ),
    Limit(
        "tau_s", "association.tau_s", "match quality", "s\u0304",
        "A sure match needs patches that match at least this well",
        "quality", 0, 100, ("paper",), names=True,
    ),
)  # fmt: skip
LIMIT_OF_KEY: Mapping[str, Limit] = {limit.key: limit for limit in LIMITS}


@dataclass(frozen=True)
class Trial:
    """Limits that a person tries out on a result.

    Attributes:
        own: the settings that the result was decided with.
        rule: of the trial.
        steps: sliders that were moved, by key; all others stand at the result's own limit, to the last bit.
    """

    own: Settings
    rule: str
    steps: Mapping[str, int]

    @classmethod
    def of(cls, own: Settings) -> Trial:
        """Nothing tried yet."""
        return cls(own, own.change.rule, {})

    def with_step(self, key: str, step: int) -> Trial:
        """A copy with one slider elsewhere; ``ValueError`` beyond its ends."""
        limit = LIMIT_OF_KEY[key]
        if not limit.low <= step <= limit.high:
            raise ValueError(f"{key} goes from {limit.low} to {limit.high}")
        steps = {**self.steps, key: step}
        if step == limit.step_of(self.own):
            del steps[key]
        return Trial(self.own, self.rule, steps)

    def with_rule(self, rule: str) -> Trial:
        """A copy with another rule of decision."""
        return Trial(self.own, rule, self.steps)

    def step(self, limit: Limit) -> int:
        """Where a slider stands."""
        return self.steps.get(limit.key, limit.step_of(self.own))

    @property
    def settings(self) -> Settings:
        """What the result is to be decided with."""
        settings = self.own.override("change.rule", self.rule)
        for key, step in self.steps.items():
            limit = LIMIT_OF_KEY[key]
            settings = settings.override(limit.setting, limit.value_of(step))
        return settings

    @property
    def differences(self) -> tuple[str, ...]:
        """What differs from the result's own limits and matters, in words."""
        said = [] if self.rule == self.own.change.rule else [f"decided by {RULES[self.rule]}"]
        for limit in LIMITS:
            if limit.key in self.steps and (limit.names or self.rule in limit.rules):
                own = limit.words(limit.step_of(self.own))
                said.append(f"{limit.title} {limit.words(self.steps[limit.key])} instead of {own}")
        return tuple(said)
