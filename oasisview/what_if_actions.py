"""What one person tries out: other limits on the finished map, seen at once, recorded only when applied."""

from __future__ import annotations

import logging
import threading
from functools import partial

from oasisview import events, wording
from oasisview.page import Page
from oasisview.panels.preview import preview_html
from oasisview.panels.what_if import controls_html, outcome_html, unavailable_html
from oasisview.preview import Preview
from oasisview.review import ConflictError, Group
from oasisview.scene.map_view import VisitLabels
from oasisview.shell import Shell
from oasisview.what_if_groups import what_if_groups
from oasisview.what_if_limits import LIMITS, RULES, Trial
from oasisview.workbench import Workbench
from pipeline.association.cases import match_case
from pipeline.change.relabel import Relabelled, WhatIf, what_if
from pipeline.errors import InputError, OasisError
from pipeline.result import ChangeLabel
from pipeline.settings import Settings

_log = logging.getLogger(__name__)


class WhatIfActions:
    """The what-if tab of one page.

    Args:
        shell, page, bench: the tab, its panels and the open result.
        preview: colours of the map.
        lock: held while the page's choices change.
    """

    def __init__(
        self, shell: Shell, page: Page, bench: Workbench, preview: Preview, lock: threading.RLock
    ) -> None:
        self._shell = shell
        self._page = page
        self._bench = bench
        self._preview = preview
        self._lock = lock
        self._again: WhatIf | None = None
        self._trial = Trial.of(Settings())
        self._relabelled: Relabelled | None = None
        self._seen_event_id = bench.decisions.last_event_id

    def bind(self) -> None:
        """Connect the tab's events."""
        on = self._shell.on_event
        for limit in LIMITS:
            steps = events.whole_number(limit.low, limit.high)
            on(f"what_if_{limit.key}", partial(self.set_limit, limit.key), steps, latest_only=True)
        on("what_if_rule", self.set_rule, events.choice(*RULES))
        on("what_if_reset", lambda _: self.reset())
        on("what_if_apply", lambda _: self.ask_to_apply())
        on("what_if_reason", self.apply, events.text())

    def open(self) -> None:
        """Fill the tab once."""
        with self._lock:
            try:
                self._again = what_if(self._bench.result)
                self._trial = Trial.of(Settings.from_dict(self._bench.result.manifest.get("settings", {})))
            except InputError as error:  # settings that this version does not know
                _log.info("no what-if: %s", error)
                self._page.what_if.show(unavailable_html(wording.NO_WHAT_IF), "")
                return
            except OasisError as error:
                _log.warning("%s", error)
                self._page.what_if.show(unavailable_html(str(error)), "")
                return
            # Rules may have changed since: what they say now is then no change of limits.
            if self._again is None or self._again.under(self._trial.own).flips:
                self._again = None
                self._page.what_if.show(unavailable_html(wording.NO_WHAT_IF), "")
                return
            self._show_controls()
            self._show_outcome()

    def set_limit(self, key: str, step: int) -> None:
        """One slider was moved."""
        with self._lock:
            self._try(self._trial.with_step(key, step))

    def set_rule(self, rule: str) -> None:
        """What decides."""
        with self._lock:
            self._try(self._trial.with_rule(rule))
            self._show_controls()

    def reset(self) -> None:
        """Back to the limits of the result."""
        with self._lock:
            self._try(Trial.of(self._trial.own))
            self._show_controls()

    def ask_to_apply(self) -> None:
        """Ask for a reason; the limits are suggested as one."""
        with self._lock:
            count = len(_objects(self._groups()))
            if count:
                self._shell.ask_text(
                    f"Apply these limits to {count} object{'' if count == 1 else 's'}?",
                    f"One undo takes all of it back. {wording.REASON_HINT}",
                    f"What if: {', '.join(self._trial.differences)}",
                    "what_if_reason",
                )

    def apply(self, reason: str) -> None:
        """Record what is tried as one decision; others' decisions meanwhile are a conflict."""
        with self._lock:
            groups = self._groups()
            if not groups:
                return
            try:
                self._bench.decisions.apply_what_if(
                    groups,
                    who=self._shell.user,
                    reason=reason or wording.NO_REASON,
                    seen_event_id=self._seen_event_id,
                )
            except ConflictError as conflict:
                self._bench.decisions.refresh()
                self._show_outcome()
                self._shell.toast(str(conflict))
                return
            self.reset()
            count = len(_objects(groups))
            self._shell.toast(f"Saved: {count} object{'' if count == 1 else 's'} by other limits.", undo=True)

    def _groups(self) -> list[Group]:
        if self._relabelled is None:
            return []
        return what_if_groups(self._relabelled, self._bench.decisions.decided_fragments())

    def follow(self) -> None:
        """Somebody decided something: what people decided is kept as it is."""
        with self._lock:
            if self._relabelled is not None:
                self._show_outcome()

    def _try(self, trial: Trial) -> None:
        if self._again is None:
            return
        if trial.rule == "evidence" and not self._again.can_decide_by_evidence:
            self._shell.toast(wording.NO_OVERLAP)
            return
        self._trial = trial
        if trial.differences:
            self._relabelled = self._again.under(trial.settings)
            bar = preview_html(f"what if: {', '.join(trial.differences)}")
            self._preview.show(bar, self._labels(self._relabelled), self.reset)
        else:
            self._relabelled = None
            self._preview.end(self.reset)
        self._show_outcome()

    def _labels(self, relabelled: Relabelled) -> VisitLabels:
        """What people decided stands; the rest as tried."""
        verdicts = self._bench.decisions.verdicts

        def label(visit: int, object_id: int) -> ChangeLabel | None:
            verdict = verdicts.get(object_id)
            return verdict.label if verdict is not None else relabelled.by_visit[visit].get(object_id)

        return partial(label, 0), partial(label, 1)

    def _show_controls(self) -> None:
        can = self._again is not None and self._again.can_decide_by_evidence
        self._page.what_if.show_controls(controls_html(self._trial, can_change_rule=can))

    def _show_outcome(self) -> None:
        relabelled = self._relabelled or Relabelled(({}, {}), ())
        # What is on the screen is what applying is based on: newer decisions of others are a conflict.
        self._seen_event_id = self._bench.decisions.last_event_id
        decided = {f.object_id for f in self._bench.decisions.decided_fragments()}
        applicable = len(_objects(self._groups()))
        self._page.what_if.show_outcome(
            outcome_html(
                self._bench.catalogue, self._trial, relabelled, decided, applicable, self._cases_changed()
            )
        )

    def _cases_changed(self) -> int:
        """Objects whose best match would be called another case; sure matches are named by two limits."""
        gates = self._trial.settings.association
        return sum(
            match_case(item.sigma, item.s_bar, gates.tau_sigma, gates.tau_s) is not item.case
            for item in self._bench.catalogue.objects.values()
            if "tau_sigma" in self._trial.steps or "tau_s" in self._trial.steps
        )


def _objects(groups: list[Group]) -> set[int]:
    """The objects of the result that groups speak of."""
    return {fragment.object_id for group in groups for fragment in group.members}
