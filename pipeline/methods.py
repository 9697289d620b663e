"""Methods that decide what changed: the engine's own and the baselines, behind one interface.

All methods get the same keyframes, surfaces, features, masks and views of each other's places, and their
outcome becomes a result folder in the same way. A method is one new implementation named in ``METHODS``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.assemble import Assembled
from pipeline.change.observe import MutualObservation
from pipeline.correspondence.compare import Comparison, Covisibility, VisitImages
from pipeline.errors import InputError
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects
from pipeline.perception.protocols import FeatureExtractor
from pipeline.settings import Settings


@dataclass(frozen=True)
class MappedVisits:
    """What every method starts from; pairs are (previous, current).

    Attributes:
        geometries: surfaces, keyframes and stores.
        covisibility: which keyframes see the same place.
        observation: what each visit saw of the other's surface.
        features: stored feature map of a keyframe, (H_f, W_f, c).
        images: colour image of a keyframe, (H, W, 3) uint8.
        extractor: made the features.
        settings: of the run.
    """

    geometries: tuple[SessionGeometry, SessionGeometry]
    covisibility: Covisibility
    observation: MutualObservation
    features: tuple[Callable[[int], NDArray[np.float16]], Callable[[int], NDArray[np.float16]]]
    images: tuple[Callable[[int], NDArray[np.uint8]], Callable[[int], NDArray[np.uint8]]]
    extractor: FeatureExtractor
    settings: Settings


@dataclass(frozen=True)
class Outcome:
    """What a method hands over to be written.

    Attributes:
        assembled: objects, events, score matrix, belief and object ids.
        evidence: of the previous and the current visit, structured rows in instance order; the columns are
            the method's own.
        quality: figures about the whole pair, for the manifest.
        moves: pairs of objects that were laid over each other, structured rows; None where the method lays
            none.
        basis: what the labels follow from, to be decided anew under other limits
            (``change.basis.DecisionBasis.arrays``); None where the method's labels do not.
    """

    assembled: Assembled
    evidence: tuple[NDArray[np.void], NDArray[np.void]]
    quality: dict[str, float]
    moves: NDArray[np.void] | None = None
    basis: dict[str, NDArray[Any]] | None = None


class Method(Protocol):
    """Finds the objects of two visits and says what became of each.

    Both steps are stages of a run: what ``find_objects`` returns is kept and read back when an interrupted
    run goes on, so ``conclude`` must follow from its arguments alone.
    """

    name: str

    def find_objects(self, mapped: MappedVisits) -> tuple[SessionObjects, SessionObjects]:
        """Object maps of the previous and the current visit."""

    def conclude(
        self,
        mapped: MappedVisits,
        visits: tuple[VisitImages, VisitImages],
        comparison: Comparison,
        on_submap: Callable[[int], None],
    ) -> Outcome:
        """Labels and identities.

        Args:
            mapped: as given to ``find_objects``.
            visits: the visits with their objects.
            comparison: patch matches of all co-visible keyframes; a method need not look at them.
            on_submap: called with the number of submaps of the current visit that are decided.
        """


def _oasis() -> Method:
    from pipeline.oasis import OasisMethod

    return OasisMethod()


def _geometric() -> Method:
    from pipeline.baselines.geometric import GeometricMethod

    return GeometricMethod()


def _conceptgraphs() -> Method:
    from pipeline.baselines.conceptgraphs import ConceptGraphsMethod

    return ConceptGraphsMethod()


def _wheres_my_glasses() -> Method:
    from pipeline.baselines.wheres_my_glasses import WheresMyGlassesMethod

    return WheresMyGlassesMethod()


METHODS: dict[str, Callable[[], Method]] = {
    "oasis": _oasis,
    "geometric": _geometric,
    "conceptgraphs": _conceptgraphs,
    "wheres-my-glasses": _wheres_my_glasses,
}


def chosen_method(settings: Settings) -> Method:
    """The method that the settings name.

    Raises:
        InputError: there is no such method.
    """
    name = settings.run.method
    if name not in METHODS:
        raise InputError(f"there is no method {name!r}", f"choose one of {', '.join(METHODS)}")
    return METHODS[name]()
