"""The engine's own method: objects refined by change, patch-to-mask association, evidence per place."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from pipeline.assemble import assemble
from pipeline.association.moves import moves_table
from pipeline.change.basis import DecisionBasis
from pipeline.change.change_score import appearance_trust
from pipeline.change.decide import decide
from pipeline.change.proposals import propose_changes
from pipeline.correspondence.compare import Comparison, VisitImages
from pipeline.correspondence.pattern_comparison import compare_patterns
from pipeline.mapping.find_objects import find_objects
from pipeline.mapping.objects import SessionObjects
from pipeline.methods import MappedVisits, Outcome
from pipeline.perception.registry import mask_generator

VISITS = 2


class OasisMethod:
    """See the module's docstring."""

    name = "oasis"

    def find_objects(self, mapped: MappedVisits) -> tuple[SessionObjects, SessionObjects]:
        """Objects of both visits at once: they are independent."""
        observation, settings = mapped.observation, mapped.settings
        observed = (observation.of_previous, observation.of_current)
        is_noise = (observation.is_noise0, observation.is_noise1)

        def find(visit: int) -> SessionObjects:
            proposals = propose_changes(
                mapped.geometries[visit],
                observed[visit],
                is_noise[visit],
                settings.observation,
                settings.proposals,
            )
            return find_objects(
                mapped.geometries[visit],
                proposals,
                is_noise[visit],
                mask_generator(settings),
                mapped.extractor,
                mapped.features[visit],
                mapped.images[visit],
                settings,
            )

        with ThreadPoolExecutor(VISITS) as threads:
            previous, current = threads.map(find, range(VISITS))
        return previous, current

    def conclude(
        self,
        mapped: MappedVisits,
        visits: tuple[VisitImages, VisitImages],
        comparison: Comparison,
        on_submap: Callable[[int], None],
    ) -> Outcome:
        """Decide submap by submap and assemble."""
        settings = mapped.settings
        patterns = compare_patterns(*visits, mapped.covisibility, settings.pattern)
        conclusion = decide(
            *visits, mapped.observation, comparison, patterns, mapped.extractor, settings, on_submap
        )
        final = conclusion.decisions[-1]
        tables = [
            evidence.objects.table(log_odds=final.log_odds[visit], move_log_odds=final.move_log_odds[visit])
            for visit, evidence in enumerate((conclusion.previous, conclusion.current))
        ]
        quality = {
            "appearance_scale_log": round(conclusion.appearance_scale, 4),
            "appearance_trust": round(appearance_trust(conclusion.appearance_scale, settings.change), 4),
        }
        assembled = assemble(*visits, conclusion, settings)
        moves = moves_table(conclusion.moves, assembled.ids0, assembled.ids1)
        basis = DecisionBasis(
            (conclusion.previous, conclusion.current),
            conclusion.association.evidence,
            conclusion.association.proposals,
            conclusion.overlap,
            conclusion.moves,
        )
        return Outcome(assembled, (tables[0], tables[1]), quality, moves, basis.arrays())
