"""2D average precision of changed objects as in SceneDiff (Wu et al., ECCV 2026): per image and per scene.

Ground-truth masks: the labelled points of a visit are drawn into each of its keyframes, at the resolution of
the result's masks, hidden surfaces removed (see ``truth_images``); a changed true object's mask are the
pixels of its points. Predicted masks: the result's own object masks of the keyframe, of objects labelled as
changed (disappeared in the previous visit, appeared in the current one, moved in both), with the object's
confidence.

*Pixels*: intersection over union of all changed pixels, all keyframes merged.
*Per image*: every mask in every keyframe is a detection. In order of confidence it takes the true mask of
that image with the greatest IoU, if that is above 0.5 and not taken (duplicates: 1, a second detection of a
mask is a false positive). Average precision after VOC. *Per scene*: every object is one detection, judged in
one keyframe; moved ones count once per visit. *With change type*: moved and not moved are told apart, and a
moved object is right when its masks in both visits match those of one truly moved object.

What differs here: the published code judges an object in the frame of its highest confidence; here it
has one confidence, so the keyframe of its largest mask is taken. Masks under ``MIN_MASK_PX`` are left out on
both sides, and so are predicted masks that lie mostly on objects that are not scored.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.average_precision import average_precision
from pipeline.evaluation.matched import Matched
from pipeline.evaluation.pointwise import CHANGES
from pipeline.evaluation.tables import aligned, number
from pipeline.evaluation.truth_images import object_image, point_spacing_m
from pipeline.evaluation.units import SCORED_LABELS
from pipeline.result import ChangeLabel

MIN_IOU = 0.5
MIN_MASK_PX = 16
MASK_STRIDE = 2  # of SessionResult.object_mask
UNSCORED = -1

_SHOWN_IN = {
    ChangeLabel.DISAPPEARED: (0,),
    ChangeLabel.APPEARED: (1,),
    ChangeLabel.MOVED: (0, 1),
}


@dataclass(frozen=True)
class KeyframeMasks:
    """Changed masks of one keyframe: areas and overlaps in pixels.

    Attributes:
        true_px, predicted_px: area by object id.
        shared_px: by (true, predicted) object id.
        changed_px: pixels that changed in truth and in the prediction, and in at least one of them; what
            is not scored is in neither.
    """

    session: int
    true_px: dict[int, int]
    predicted_px: dict[int, int]
    shared_px: dict[tuple[int, int], int]
    changed_px: tuple[int, int] = (0, 0)

    def best_match(self, predicted_id: int, allowed: set[int] | None = None) -> int | None:
        """True object with the greatest IoU above ``MIN_IOU``; ``allowed`` limits the choice."""
        best, best_iou = None, MIN_IOU
        for true_id, area in self.true_px.items():
            if allowed is not None and true_id not in allowed:
                continue
            shared = self.shared_px.get((true_id, predicted_id), 0)
            iou = shared / (area + self.predicted_px[predicted_id] - shared)
            if iou > best_iou:
                best, best_iou = true_id, iou
        return best


@dataclass(frozen=True)
class SceneDiffScores:
    """Average precisions and IoU; None where nothing changed in view.

    Attributes:
        pixel_iou: changed pixels of all keyframes together, no objects and no confidence.
        per_image: of masks in images; per_scene: of objects; per_scene_typed: of objects with change type.
        true_masks, true_objects, true_typed_objects: what there was to find.
        predicted_masks, predicted_objects: detections that were counted.
    """

    pixel_iou: float | None
    per_image: float | None
    per_scene: float | None
    per_scene_typed: float | None
    true_masks: int
    true_objects: int
    true_typed_objects: int
    predicted_masks: int
    predicted_objects: int

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(vars(self))

    def lines(self) -> list[str]:
        """The table."""
        rows = [
            ("average precision", "AP", "to find", "detections"),
            ("per image", number(self.per_image), str(self.true_masks), str(self.predicted_masks)),
            ("per scene", number(self.per_scene), str(self.true_objects), str(self.predicted_objects)),
            ("per scene, change type", number(self.per_scene_typed), str(self.true_typed_objects), ""),
        ]
        pixels = f"IoU of changed pixels, all keyframes together: {number(self.pixel_iou)}"
        return [*aligned(rows), pixels]


def scenediff_scores(matched: Matched) -> SceneDiffScores:
    """Score a result of two visits."""
    moved = matched.truth.points.label == ChangeLabel.MOVED
    moved_true = {int(true_id) for true_id in np.unique(matched.truth.points.object_id[moved])} - {0}
    confidence = {object_id: item.confidence for object_id, item in matched.objects.items()}
    return score_masks(list(keyframe_masks(matched)), confidence, dict(matched.labels), moved_true)


def score_masks(
    keyframes: list[KeyframeMasks],
    confidence: dict[int, float],
    labels: dict[int, ChangeLabel],
    moved_true: set[int],
) -> SceneDiffScores:
    """The three average precisions of masks that are counted already."""
    image_detections = sorted(
        ((confidence[p], k, p) for k, masks in enumerate(keyframes) for p in masks.predicted_px),
        key=lambda detection: -detection[0],
    )
    taken: set[tuple[int, int]] = set()
    image_right = []
    for _, k, predicted_id in image_detections:
        true_id = keyframes[k].best_match(predicted_id)
        image_right.append(true_id is not None and (k, true_id) not in taken)
        if true_id is not None:
            taken.add((k, true_id))
    scene = _scene_detections(keyframes, confidence)
    typed_right = _typed_detections(scene, labels, moved_true)
    seen = {(masks.session, true_id) for masks in keyframes for true_id in masks.true_px}
    typed = {true_id if true_id in moved_true else (session, true_id) for session, true_id in seen}
    true_masks = sum(len(masks.true_px) for masks in keyframes)
    claimed: set[tuple[int, int]] = set()
    scene_right = []
    for (session, predicted_id), masks in scene.items():
        true_id = masks.best_match(predicted_id)
        scene_right.append(true_id is not None and (session, true_id) not in claimed)
        if true_id is not None:
            claimed.add((session, true_id))
    shared, either = (sum(masks.changed_px[side] for masks in keyframes) for side in (0, 1))
    return SceneDiffScores(
        pixel_iou=shared / either if either else None,
        per_image=average_precision([c for c, _, _ in image_detections], image_right, true_masks),
        per_scene=average_precision([confidence[p] for _, p in scene], scene_right, len(seen)),
        per_scene_typed=average_precision(
            [confidence[predicted_id] for predicted_id in typed_right], list(typed_right.values()), len(typed)
        ),
        true_masks=true_masks,
        true_objects=len(seen),
        true_typed_objects=len(typed),
        predicted_masks=len(image_detections),
        predicted_objects=len(scene),
    )


def _scene_detections(
    keyframes: list[KeyframeMasks], confidence: dict[int, float]
) -> dict[tuple[int, int], KeyframeMasks]:
    """(visit, predicted object) -> the keyframe with its largest mask; the most confident first."""
    best: dict[tuple[int, int], KeyframeMasks] = {}
    for masks in keyframes:
        for predicted_id, area in masks.predicted_px.items():
            key = (masks.session, predicted_id)
            if key not in best or area > best[key].predicted_px[predicted_id]:
                best[key] = masks
    return dict(sorted(best.items(), key=lambda item: (-confidence[item[0][1]], item[0])))


def _typed_detections(
    scene: dict[tuple[int, int], KeyframeMasks], labels: dict[int, ChangeLabel], moved_true: set[int]
) -> dict[int, bool]:
    """Whether each predicted object is right with its change type; a moved one is one detection."""
    claimed: set[tuple[int, int]] = set()
    right: dict[int, bool] = {}
    for predicted_id in dict.fromkeys(predicted_id for _, predicted_id in scene):
        views = {session: masks for (session, p), masks in scene.items() if p == predicted_id}
        is_moved = labels[predicted_id] == ChangeLabel.MOVED
        matches = set()
        for masks in views.values():
            kinds = {true_id for true_id in masks.true_px if (true_id in moved_true) == is_moved}
            matches.add(masks.best_match(predicted_id, kinds))
        true_id = matches.pop() if len(matches) == 1 else None
        # A move must be right in both visits; one that is shown in one visit only cannot be.
        found = true_id is not None and len(views) == 1 + is_moved
        key = (0 if is_moved else min(views), true_id or 0)
        right[predicted_id] = found and key not in claimed
        if found:
            claimed.add(key)
    return right


def keyframe_masks(matched: Matched) -> Iterator[KeyframeMasks]:
    """Masks of every keyframe of both visits, one at a time."""
    points = matched.truth.points
    for index, session in enumerate(matched.result.sessions):
        mine = np.flatnonzero(points.session == index)
        places, owner, label = points.points_world[mine], points.object_id[mine], points.label[mine]
        spacing_m = point_spacing_m(places)
        shown = shown_objects(owner, label)
        for k, keyframe in enumerate(session.keyframes):
            camera = keyframe.camera.strided(MASK_STRIDE)
            true = shown[object_image(places, owner, camera, keyframe.T_world_camera, spacing_m)]
            yield count_masks(index, true, _changed_mask(matched, index, session.object_mask(k)))


def shown_objects(object_id: NDArray[np.integer], label: NDArray[np.integer]) -> NDArray[np.int64]:
    """What each true object of a visit is shown as: its id if it changed, 0 if not, or ``UNSCORED``."""
    shown = np.zeros(int(object_id.max(initial=0)) + 1, dtype=np.int64)
    for true_id in np.unique(object_id[object_id > 0]).tolist():
        main = int(np.bincount(label[object_id == true_id]).argmax())
        shown[true_id] = true_id if main in CHANGES else 0
        if main not in SCORED_LABELS:
            shown[true_id] = UNSCORED
    return shown


def count_masks(session: int, true: NDArray[np.int64], predicted: NDArray[np.int64]) -> KeyframeMasks:
    """Areas and overlaps of two (h, w) images of object ids (0 = none, ``UNSCORED`` = not scored)."""
    pairs, counts = np.unique(np.stack([true.ravel(), predicted.ravel()]), axis=1, return_counts=True)
    table = {(int(t), int(p)): int(c) for t, p, c in zip(*pairs, counts, strict=True)}
    true_px: dict[int, int] = {}
    predicted_px: dict[int, int] = {}
    for (t, p), count in table.items():
        if t > 0:
            true_px[t] = true_px.get(t, 0) + count
        if p > 0:
            predicted_px[p] = predicted_px.get(p, 0) + count
    return KeyframeMasks(
        session,
        {t: area for t, area in true_px.items() if area >= MIN_MASK_PX},
        {
            p: area
            for p, area in predicted_px.items()
            if area >= MIN_MASK_PX and table.get((UNSCORED, p), 0) <= area / 2
        },
        {pair: count for pair, count in table.items() if min(pair) > 0},
        (
            sum(count for pair, count in table.items() if min(pair) > 0),
            sum(count for pair, count in table.items() if min(pair) >= 0 and max(pair) > 0),
        ),
    )


def _shown_in(label: ChangeLabel | None) -> tuple[int, ...]:
    return _SHOWN_IN.get(label, ()) if label is not None else ()


def _changed_mask(matched: Matched, session: int, mask: NDArray[np.uint16]) -> NDArray[np.int64]:
    ids = np.unique(mask)
    shown = [i for i in ids.tolist() if i > 0 and session in _shown_in(matched.labels.get(i))]
    return np.where(np.isin(mask, shown), mask, 0).astype(np.int64)
