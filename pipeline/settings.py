"""Every default of the engine, in one place, with its unit and the paper's symbol.

Sections are frozen dataclasses; ``Settings()`` is the documented default and is stored whole with each
result. ``setting`` attaches unit, symbol and meaning, from which the command's help and the docs are made.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any, Literal, get_type_hints

from pipeline.errors import InputError

_LISTED = "`oasisview run --settings` lists them all"


def setting(default: Any, help: str, *, unit: str = "", symbol: str = "", least: float | None = None) -> Any:
    """A dataclass field that knows its unit, the paper's symbol and the smallest value that makes sense."""
    return field(default=default, metadata={"help": help, "unit": unit, "symbol": symbol, "least": least})


@dataclass(frozen=True)
class RunSettings:
    """Which method decides what changed."""

    method: Literal["oasis", "geometric", "conceptgraphs", "wheres-my-glasses"] = setting(
        "oasis", "oasis = this engine; the others are baselines on the same keyframes (pipeline/baselines)"
    )


@dataclass(frozen=True)
class ArchiveSettings:
    """What is accepted as an archive."""

    max_unpacked_bytes: int = setting(64 * 10**9, "larger zip and tar archives are refused", unit="B")
    max_members: int = setting(1_000_000, "zip and tar archives of more files are refused")
    max_ratio: float = setting(200.0, "packed archives that grow by more than this are refused")
    ratio_from_bytes: int = setting(10**9, "smaller unpacked sizes may have any ratio", unit="B")
    max_time_gap_s: float = setting(0.02, "images and poses farther apart are not associated", unit="s")


@dataclass(frozen=True)
class ImageSettings:
    """Size at which images are processed."""

    max_width: int = setting(640, "wider images are scaled down to this width", unit="px", least=32)
    geometry_stride: int = setting(2, "geometry uses every n-th pixel", unit="px", least=1)
    max_depth_m: float = setting(30.0, "farther depth is ignored", unit="m")


@dataclass(frozen=True)
class KeyframeSettings:
    """Adaptive keyframe selection (paper, Sec. III-B.1)."""

    select: bool = setting(True, "select keyframes by motion; off = every frame is one")
    sensor_translation_m: float = setting(0.5, "sensor and LiDAR depth", unit="m", symbol="delta_x")
    sensor_rotation_deg: float = setting(20.0, "sensor and LiDAR depth", unit="deg", symbol="delta_theta")
    learned_translation_m: float = setting(1.0, "learned depth", unit="m", symbol="delta_x")
    learned_rotation_deg: float = setting(30.0, "learned depth", unit="deg", symbol="delta_theta")
    sparse_step: float = setting(
        0.2, "an archive whose median step is at least this share of a threshold is sparse already: keep all"
    )
    submap_size: int = setting(10, "keyframes in a submap", symbol="N_sub", least=1)


@dataclass(frozen=True)
class SurfaceSettings:
    """Voxel maps: the scale of everything geometric follows from what a pixel covers."""

    voxel_size_m: float = setting(0.0, "edge of a voxel; 0 = from the pixel footprint", unit="m", least=0)
    footprint_factor: float = setting(1.3, "voxel edge over the footprint of one stride at the depth below")
    depth_percentile: float = setting(80.0, "percentile of depth that sets the voxel edge", unit="%")
    min_voxel_m: float = setting(0.016, "smallest automatic voxel", unit="m")
    max_voxel_m: float = setting(0.15, "largest automatic voxel", unit="m")
    min_samples: int = setting(3, "a voxel counts from this many pixels on")
    truncation_voxels: float = setting(4.0, "truncation distance of the TSDF", unit="voxels")
    min_incidence_cosine: float = setting(0.08, "surfaces seen flatter than this are not fused")


@dataclass(frozen=True)
class RegistrationSettings:
    """Laying the current visit on the previous one before they are compared."""

    enabled: bool = setting(True, "correct small pose errors between the visits; off = poses as recorded")
    samples: int = setting(3000, "surface points that take part, even over directions", least=100)
    reach_m: float = setting(0.1, "least distance within which counterparts are looked for first", unit="m")
    reach_voxels: float = setting(4.0, "the same, in voxels", unit="voxels")
    reach_deg: float = setting(2.0, "the same, as a turn of the whole visit about its middle", unit="deg")
    max_reach_m: float = setting(1.0, "counterparts are never looked for farther away", unit="m")
    last_reach_voxels: float = setting(2.0, "counterparts lie this near at the end", unit="voxels")
    loose_below: float = setting(
        0.01, "directions of smaller eigenvalues of the normal matrix are left as they are"
    )
    max_cost_ratio: float = setting(
        0.95, "a correction is made when the robust cost falls at least to this share"
    )
    max_translation_m: float = setting(0.3, "a larger correction is no pose error and is not made", unit="m")
    max_rotation_deg: float = setting(5.0, "a larger correction is no pose error and is not made", unit="deg")
    # Off: tried on two pairs (benchmarks/pose_noise.py, jitter), of which one gained change F1.
    keyframes: bool = setting(False, "correct single keyframes too, where most of them need it")
    keyframe_samples: int = setting(1000, "pixels of a keyframe that take part", least=100)
    keyframe_translation_m: float = setting(0.02, "expected error of a keyframe's pose", unit="m")
    keyframe_rotation_deg: float = setting(1.0, "expected error of a keyframe's pose", unit="deg")
    keyframe_matches: float = setting(
        20.0, "what all matches of a keyframe are worth in independent ones, against that expectation"
    )
    keyframe_max_cost_ratio: float = setting(0.9, "as max_cost_ratio, for a keyframe")
    keyframe_max_translation_m: float = setting(0.1, "as max_translation_m, for a keyframe", unit="m")

    def reaches_m(self, voxel_m: float, radius_m: float) -> tuple[float, float]:
        """Within what distance counterparts are looked for at first and at the end; of a view or map of a
        radius (metres)."""
        last_m = self.last_reach_voxels * voxel_m
        turned_m = math.radians(self.reach_deg) * radius_m
        first_m = max(self.reach_m, self.reach_voxels * voxel_m, turned_m)
        return max(min(first_m, self.max_reach_m), last_m), last_m


@dataclass(frozen=True)
class PerceptionSettings:
    """Which backends see."""

    features: str = setting("embedded", "feature extractor")
    masks: str = setting("embedded", "mask generator")
    depth: str = setting("archive", "depth source: the archive's own, or an estimator")


@dataclass(frozen=True)
class DescriptorSettings:
    """The embedded 168-d descriptor: gradients and colour, no weights."""

    patch_px: int = setting(16, "patch edge at processing size", unit="px", least=1)
    colour_weight: float = setting(0.4, "share of colour in the correlation")
    colour_sigma_lab: float = setting(20.0, "kernel width of the colour similarity", unit="Lab units")
    lightness_weight: float = setting(0.5, "weight of L against a and b")
    random_features: int = setting(48, "pairs of random Fourier features for colour")


@dataclass(frozen=True)
class DiscoverySettings:
    """Support-aware object discovery without weights, refined by geometric change.

    Distances are in voxels wherever they follow from the resolution, so that one set serves every scale.
    """

    min_voxels: int = setting(25, "smaller objects are noise", unit="voxels")
    min_views: int = setting(2, "objects must be seen in this many keyframes (1 in visits of few keyframes)")
    seed: int = setting(0, "seed of the random draws; the same seed gives the same objects")
    structure_rounds: int = setting(14, "planes tried as walls, floors and ceilings")
    structure_hypotheses: int = setting(150, "random planes per round")
    wall_area_m2: float = setting(2.0, "least area of a wall at 2 cm voxels; grows with the voxel", unit="m2")
    level_area_m2: float = setting(
        1.0, "least area of a floor at 2 cm voxels; grows with the voxel", unit="m2"
    )
    wall_hidden: float = setting(0.05, "a wall has less than this share of voxels behind it")
    level_hidden: float = setting(0.02, "a floor or ceiling has less than this share of voxels behind it")
    raised_border: float = setting(0.3, "a floor drops off along less than this share of its border")
    floor_band_voxels: float = setting(1.5, "what lies this close to the floor is floor", unit="voxels")
    support_up_cosine: float = setting(0.7, "supports face up at least this much")
    support_gap_voxels: float = setting(10.0, "boards closer than this are one support", unit="voxels")
    support_area_m2: float = setting(0.25, "least area of a support", unit="m2")
    support_area_voxels: float = setting(250.0, "least area of a support", unit="voxels^2")
    support_band_voxels: float = setting(1.3, "half the thickness of a support's layer", unit="voxels")
    contact_voxels: float = setting(2.6, "closer than this, a piece touches a support", unit="voxels")
    item_footprint: float = setting(0.35, "an item covers less than this share of its support")
    item_below: float = setting(0.1, "an item has less than this share of voxels below its support's plane")
    post_reach_m: float = setting(0.15, "a post joins the boards this far beyond its ends", unit="m")
    attach_voxels: float = setting(3.0, "floating pieces join the neighbour within this reach", unit="voxels")
    whole_change: float = setting(0.5, "a segment changed by more than this share changed as a whole")
    change_region_voxels: int = setting(30, "changed regions from this size on become objects", unit="voxels")
    unchanged_share: float = setting(
        0.15, "an unchanged part of a changed segment is parted from this share on"
    )
    change_region_proof: float = setting(
        15.0, "a changed region has so many voxels that were seen through, or more that look unlike"
    )
    loose_piece_voxels: int = setting(
        150, "loose pieces of an object from this size on are objects", unit="voxels"
    )
    loose_reach_voxels: float = setting(
        8.0, "smaller ones join the nearest object within reach", unit="voxels"
    )


@dataclass(frozen=True)
class ProposalSettings:
    """Voxels that changed, from which objects are corrected."""

    usual_percentile: float = setting(
        98.5, "colours that differ more than at this share of all places are unlike", unit="%"
    )
    lightness_weight: float = setting(0.4, "weight of lightness (shadows move) against tint")
    unlike_proof: float = setting(0.2, "weight of a voxel that looks unlike against one seen through")
    edge_sigma_lab: float = setting(
        5.0, "changes hardly spread over edges of this contrast", unit="Lab units"
    )
    spread_steps: int = setting(60, "steps of the random walk that spreads changes", least=0)


@dataclass(frozen=True)
class MergeSettings:
    """Merging lifted masks into objects across keyframes (paper, Sec. III-B.2)."""

    min_overlap: float = setting(0.3, "3D overlap (intersection over smaller) from which masks merge")
    min_similarity: float = setting(0.6, "semantic similarity from which overlapping masks merge")
    min_image_overlap: float = setting(0.5, "2D overlap from which a projected object claims a mask")


@dataclass(frozen=True)
class ObservationSettings:
    """What counts as seen, seen through, and occluded."""

    near_m: float = setting(0.2, "nearer voxels are not judged", unit="m")
    tolerance_voxels: float = setting(1.6, "depth agreement, in voxels", unit="voxels")
    tolerance_m: float = setting(0.035, "least depth agreement", unit="m")
    tolerance_per_metre: float = setting(0.006, "growth of the agreement with depth", unit="m/m")
    min_free: int = setting(2, "keyframes that must see through a voxel that others hit")
    free_ratio: float = setting(0.6, "share of observations that must see through")
    own_free_ratio: float = setting(
        0.2, "voxels that more than this share of their own visit's views see through are sensor noise"
    )
    colour_min_cosine: float = setting(0.15, "colours are read off surfaces that face the camera so much")


@dataclass(frozen=True)
class CorrespondenceSettings:
    """Co-visible pairs and dense matches (paper, Sec. III-C.1)."""

    pairs_per_keyframe: int = setting(
        3, "best co-visible keyframes of the other visit to compare with", least=1
    )
    min_shared: float = setting(0.15, "share of pixels two keyframes must both see")
    search_radius_patches: int = setting(
        4, "the heatmap looks for the best match this far around the expected place", unit="patches"
    )
    heatmap_sigma_patches: float = setting(1.0, "smoothing of the semantic heatmap", unit="patches")


@dataclass(frozen=True)
class PatternSettings:
    """Comparison of fine patterns, pixel by pixel."""

    pairs_per_keyframe: int = setting(2, "best co-visible keyframes whose pixels are compared", least=1)
    finest_pixels: float = setting(0.8, "finer than this is noise", unit="strided pixels")
    coarsest_pixels: float = setting(5.0, "coarser than this is light and paint", unit="strided pixels")
    window_pixels: int = setting(11, "patterns are correlated in windows of this size", unit="strided pixels")
    search_radius_pixels: int = setting(
        2, "a pattern is looked for this far from where the poses put it", unit="strided pixels"
    )


@dataclass(frozen=True)
class AssociationSettings:
    """Score matrix, gates and assignment (paper, Sec. III-C.2)."""

    tau_sigma: float = setting(0.3, "least match proportion of a confident pair", symbol="tau_sigma")
    tau_s: float = setting(0.85, "least mean confidence of a confident pair", symbol="tau_s")


@dataclass(frozen=True)
class MoveSettings:
    """Which object that left its place is which that took one."""

    least_change_log_odds: float = setting(-1.0, "objects less likely to have changed than this did not move")
    chroma_distance: float = setting(0.15, "objects of less like colours are not one", unit="log units")
    size_ratio: float = setting(3.0, "objects whose sizes differ by more are not one")
    partners_per_object: int = setting(6, "likest candidates that an object is laid over", least=1)
    max_registrations: int = setting(250, "most pairs of objects that are laid over each other", least=1)
    least_print_support: float = setting(
        1.5,
        "prints that agree in so many places say how two objects are laid over each other",
        unit="places",
    )
    min_rotation_deg: float = setting(
        10.0, "an object turned on the spot by more than this moved", unit="deg"
    )
    min_log_odds: float = setting(-1.6, "log odds from which two objects are one that moved")
    # Weights of association.moves, from benchmarks/fit_move_score.py on scenes that no table reports.
    bias: float = setting(-3.02, "log odds that two objects are one before any evidence")
    overlap_more_weight: float = setting(
        -0.36, "log odds for the larger share of visible surface that is shared"
    )
    overlap_less_weight: float = setting(-0.2, "log odds for the smaller share of visible surface shared")
    shared_weight: float = setting(3.01, "log odds for the share of the smaller cloud that is shared")
    likelihood_weight: float = setting(0.34, "log odds per log likelihood ratio of the colours")
    likelihood_shared_weight: float = setting(-0.11, "the same, where much of the surface is shared")
    texture_correlation_weight: float = setting(0.04, "log odds per Fisher-transformed texture correlation")
    texture_weight: float = setting(1.39, "log odds for a textured surface")
    gain_weight: float = setting(-1.79, "log odds per log unit of brightness gain")
    reach_ratio_weight: float = setting(-0.63, "log odds per log ratio of the level reaches")
    height_ratio_weight: float = setting(-0.87, "log odds per log ratio of the heights")
    vacated_weight: float = setting(1.93, "log odds for the share of both places seen to be empty")
    voxels_weight: float = setting(0.03, "log odds per log voxel of the smaller object")
    chroma_rank_weight: float = setting(-0.63, "log odds per log share of pairs of colours as like")
    print_weight: float = setting(2.22, "log odds per log number of places of a print that both show")
    print_expected_weight: float = setting(
        -0.97, "log odds per log number of places where both should show the same print"
    )
    agreement_rank_weight: float = setting(-0.25, "log odds per log share of pairs that agree as well")


@dataclass(frozen=True)
class ChangeSettings:
    """Labels (paper, Eq. 8) and what may overrule a bare mismatch."""

    rule: Literal["evidence", "paper"] = setting(
        "evidence", "evidence = the place itself must have changed; paper = Eq. 8 alone"
    )
    # Weights of change_score, from benchmarks/fit_change_score.py on scenes that no table reports; with fewer
    # false alarms than at its optimum, as real depth is noisier than generated depth.
    bias: float = setting(-3.44, "log odds of a change before any evidence")
    seen_through_weight: float = setting(9.73, "log odds for a place that was seen to be empty")
    dissimilarity_weight: float = setting(1.39, "log odds per spread of patch dissimilarity")
    residual_weight: float = setting(1.05, "log odds per spread of the median colour residual")
    texture_weight: float = setting(1.99, "log odds per spread of lost texture correlation")
    tail_weight: float = setting(1.01, "log odds per spread of the share of unexplained colours")
    pattern_weight: float = setting(1.73, "log odds per spread of lost fine pattern")
    print_here_weight: float = setting(-1.45, "log odds per log number of places whose print stayed here")
    print_elsewhere_weight: float = setting(0.8, "log odds per log number of places whose print is elsewhere")
    full_appearance_scale: float = setting(
        0.2, "colour spread between the visits up to which appearance counts fully", unit="log units"
    )
    no_appearance_scale: float = setting(
        0.28, "colour spread from which appearance does not count", unit="log units"
    )
    min_log_odds: float = setting(0.0, "log odds from which a place has changed")
    same_place_overlap: float = setting(0.1, "overlap from which two unchanged objects are one")
    replaced_overlap: float = setting(0.25, "share of the smaller bounds that a replacement has in common")
    tau_d_m: float = setting(0.1, "objects displaced by more than this have moved", unit="m", symbol="tau_d")
    nu_min: float = setting(0.5, "least coverage of a decision", symbol="nu_min")


@dataclass(frozen=True)
class ConfidenceSettings:
    """How likely labels are right; from benchmarks/fit_confidence.py on scenes that no table reports."""

    static_bias: float = setting(-2.54, "static: log odds that such a label is right, before any evidence")
    static_change: float = setting(0.95, "static: log odds per log odds of the change")
    static_coverage: float = setting(-0.09, "static: log odds for full coverage")
    static_voxels: float = setting(0.32, "static: log odds per tenfold number of voxels")
    static_move: float = setting(-0.34, "static: log odds per log odds of the likeliest move")
    changed_bias: float = setting(-5.47, "changed: log odds that such a label is right, before any evidence")
    changed_change: float = setting(0.03, "changed: log odds per log odds of the change")
    changed_coverage: float = setting(1.89, "changed: log odds for full coverage")
    changed_voxels: float = setting(1.38, "changed: log odds per tenfold number of voxels")
    changed_move: float = setting(-0.39, "changed: log odds per log odds of the likeliest move")
    moved_bias: float = setting(0.52, "moved: log odds that such a label is right, before any evidence")
    moved_change: float = setting(0.22, "moved: log odds per log odds of the change")
    moved_coverage: float = setting(0.67, "moved: log odds for full coverage")
    moved_voxels: float = setting(-0.57, "moved: log odds per tenfold number of voxels")
    moved_move: float = setting(0.78, "moved: log odds per log odds of the likeliest move")


@dataclass(frozen=True)
class BaselineSettings:
    """The baselines of the paper; values are the published ones unless the help says otherwise."""

    knn_count: int = setting(2, "geometric: nearest points of the other visit to average over", least=1)
    knn_distance_m: float = setting(
        0.1, "geometric: farther from the other visit's points, a point differs", unit="m"
    )
    knn_distance_voxels: float = setting(
        2.0,
        "geometric: least such distance where voxels are coarse (published: 0.1 m at 0.05 m)",
        unit="voxels",
    )
    range_cell_deg: float = setting(0.4, "geometric: cell of the range images", unit="deg")
    range_difference_m: float = setting(0.1, "geometric: ranges differ from this on", unit="m")
    peeling_rounds: int = setting(
        3, "geometric: times that differences are split into strong and weak", least=1
    )
    propagation_m: float = setting(
        1.0, "geometric: weak negative differences this near strong ones join", unit="m"
    )
    cluster_voxels: int = setting(
        25,
        "geometric: smaller clusters of differences share one entry (ours: it has no objects)",
        unit="voxels",
    )
    merge_similarity: float = setting(
        1.1, "conceptgraphs: least sum of overlap and similarity for a mask to join an object"
    )
    min_mask_voxels: int = setting(16, "conceptgraphs: smaller masks are skipped", unit="voxels")
    min_detections: int = setting(3, "conceptgraphs: objects of fewer masks are dropped", least=1)
    embedding_spread: float = setting(
        0.14,
        "conceptgraphs, wheres-my-glasses: embeddings of an object differ by this share of what patches"
        " of a place may, as 1 - cosine, at most (ours: CLIP's thresholds do not transfer)",
    )
    gate_m: float = setting(
        0.9, "wheres-my-glasses: an object is looked for this far around its bounds (value of POCD)", unit="m"
    )
    min_expected_share: float = setting(
        0.2, "wheres-my-glasses: share of an object in plain view from which it is expected (value of POCD)"
    )
    prior_hits: float = setting(3.0, "wheres-my-glasses: Beta prior of the stationarity (ours)")
    prior_misses: float = setting(2.0, "wheres-my-glasses: Beta prior of the stationarity (ours)")
    missing_below: float = setting(
        0.45, "wheres-my-glasses: objects less stationary are missing (value of POCD)"
    )
    displacement_m: float = setting(
        0.2,
        "objects found again farther away have moved (no value is published; ours, from development scenes)",
        unit="m",
        symbol="tau_d",
    )


@dataclass(frozen=True)
class Settings:
    """All settings of a run."""

    run: RunSettings = field(default_factory=RunSettings)
    archive: ArchiveSettings = field(default_factory=ArchiveSettings)
    image: ImageSettings = field(default_factory=ImageSettings)
    keyframes: KeyframeSettings = field(default_factory=KeyframeSettings)
    surface: SurfaceSettings = field(default_factory=SurfaceSettings)
    registration: RegistrationSettings = field(default_factory=RegistrationSettings)
    perception: PerceptionSettings = field(default_factory=PerceptionSettings)
    descriptor: DescriptorSettings = field(default_factory=DescriptorSettings)
    discovery: DiscoverySettings = field(default_factory=DiscoverySettings)
    proposals: ProposalSettings = field(default_factory=ProposalSettings)
    merge: MergeSettings = field(default_factory=MergeSettings)
    observation: ObservationSettings = field(default_factory=ObservationSettings)
    correspondence: CorrespondenceSettings = field(default_factory=CorrespondenceSettings)
    pattern: PatternSettings = field(default_factory=PatternSettings)
    association: AssociationSettings = field(default_factory=AssociationSettings)
    moves: MoveSettings = field(default_factory=MoveSettings)
    change: ChangeSettings = field(default_factory=ChangeSettings)
    confidence: ConfidenceSettings = field(default_factory=ConfidenceSettings)
    baseline: BaselineSettings = field(default_factory=BaselineSettings)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Plain nested dictionary, as stored in ``result.json``."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, dict[str, Any]]) -> Settings:
        """Inverse of :meth:`to_dict`; missing values keep their default.

        Raises:
            InputError: an unknown section or name, or a value of the wrong type.
        """
        settings = cls()
        for section, entries in values.items():
            if not isinstance(entries, dict) or not hasattr(settings, section):
                raise InputError(f"there is no section of settings {section!r}", _LISTED)
            for name, value in entries.items():
                settings = settings.override(f"{section}.{name}", value)
        return settings

    def override(self, name: str, value: Any) -> Settings:
        """A copy with ``section.name`` replaced; text is converted to the setting's type.

        Raises:
            InputError: there is no such setting, or the value does not fit its type.
        """
        section_name, _, setting_name = name.partition(".")
        section: Any = getattr(self, section_name, None)
        known = {entry.name: entry for entry in dataclasses.fields(section)} if _is_section(section) else {}
        if setting_name not in known:
            raise InputError(f"there is no setting {name!r}", _LISTED)
        converted = _convert(name, value, get_type_hints(type(section))[setting_name])
        least = known[setting_name].metadata["least"]
        if least is not None and converted < least:
            raise InputError(f"{name} cannot be {value!r}", f"it is at least {least:g}")
        return dataclasses.replace(
            self, **{section_name: dataclasses.replace(section, **{setting_name: converted})}
        )


def _is_section(value: Any) -> bool:
    return dataclasses.is_dataclass(value) and not isinstance(value, type)


def _convert(name: str, value: Any, wanted: Any) -> Any:
    choices = getattr(wanted, "__args__", None)
    if choices:
        if value not in choices:
            raise InputError(f"{name} cannot be {value!r}", f"choose one of {', '.join(map(str, choices))}")
        return value
    if wanted is bool and isinstance(value, str):
        if value.lower() not in ("true", "false", "on", "off", "1", "0"):
            raise InputError(f"{name} cannot be {value!r}", "write true or false")
        return value.lower() in ("true", "on", "1")
    try:
        converted = wanted(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} cannot be {value!r}", f"it is a number of type {wanted.__name__}") from None
    if wanted is int and float(value) != converted:
        raise InputError(f"{name} cannot be {value!r}", "it is a whole number")
    if wanted is float and not math.isfinite(converted):
        raise InputError(f"{name} cannot be {value!r}", "it is a finite number")
    return converted
