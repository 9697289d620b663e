"""Which perception backends there are, by the name that settings and the command use."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.errors import InputError
from pipeline.perception.protocols import FeatureExtractor, MaskGenerator
from pipeline.settings import Settings


def _embedded_features(settings: Settings) -> FeatureExtractor:
    from pipeline.perception.embedded.descriptor import GradientColourDescriptor

    return GradientColourDescriptor(settings.descriptor)


def _embedded_masks(settings: Settings) -> MaskGenerator:
    from pipeline.perception.embedded.masks import DiscoveredMasks

    return DiscoveredMasks(settings.discovery)


FEATURE_EXTRACTORS: dict[str, Callable[[Settings], FeatureExtractor]] = {"embedded": _embedded_features}
MASK_GENERATORS: dict[str, Callable[[Settings], MaskGenerator]] = {"embedded": _embedded_masks}


def feature_extractor(settings: Settings) -> FeatureExtractor:
    """The feature extractor that the settings name.

    Raises:
        InputError: there is no such backend.
    """
    name = settings.perception.features
    if name not in FEATURE_EXTRACTORS:
        raise InputError(f"there are no features {name!r}", f"choose one of {', '.join(FEATURE_EXTRACTORS)}")
    return FEATURE_EXTRACTORS[name](settings)


def mask_generator(settings: Settings) -> MaskGenerator:
    """The mask generator that the settings name.

    Raises:
        InputError: there is no such backend.
    """
    name = settings.perception.masks
    if name not in MASK_GENERATORS:
        raise InputError(f"there are no masks {name!r}", f"choose one of {', '.join(MASK_GENERATORS)}")
    return MASK_GENERATORS[name](settings)
