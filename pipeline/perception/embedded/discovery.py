"""Objects on a fused surface, found from geometry alone: structure away, supports cut, the rest in pieces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.mapping.objects import join_nearest
from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.attachment import Attachment
from pipeline.perception.embedded.components import Pieces, first_seen_order
from pipeline.perception.embedded.gravity_view import GravityView
from pipeline.perception.embedded.structure import find_structure
from pipeline.perception.embedded.supports import find_supports, layer_of_voxels
from pipeline.settings import DiscoverySettings


def discover_objects(surface: FusedSurface, settings: DiscoverySettings) -> NDArray[np.int32]:
    """Segment number of each of the M voxels: 0 = structure or noise, 1..n = objects.

    Numbers are compact and follow the objects' first voxels; the same surface and settings give the same
    numbers. A support (a table, a shelf) is an object, as is each thing that stands on it.
    """
    if not len(surface.points_world):
        return np.zeros(0, np.int32)
    is_structure = find_structure(surface, settings, settings.seed).is_structure
    view = GravityView.of(surface)
    supports = find_supports(surface, view, is_structure, settings)
    layer = layer_of_voxels(view, is_structure, supports, settings.support_band_voxels)
    pieces = Pieces.of(~is_structure & (layer < 0), surface.neighbours)
    attachment = Attachment(surface, view, pieces, supports, layer, settings)
    attachment.settle_contacts()
    attachment.hold_loose_pieces(is_structure)
    nodes = attachment.nodes()
    labels = np.zeros(len(nodes), np.int64)
    held = nodes >= 0
    labels[held] = attachment.roots()[nodes[held]] + 1
    segments = first_seen_order(labels, settings.min_voxels)
    return join_nearest(surface, segments, ~is_structure & (segments == 0), settings.loose_reach_voxels)
