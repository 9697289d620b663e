"""One vector per mask, and one per object."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.baselines.embedding import VisitEmbeddings, averaged_embeddings, min_similarity
from pipeline.perception.protocols import SimilarityScale
from pipeline.settings import Settings


class PlainExtractor:
    """Features as they are stored; the light is a factor on the current visit's first channel."""

    similarity = SimilarityScale(threshold=0.9, softness=0.02)

    def comparable(
        self, previous: np.ndarray, current: np.ndarray, light: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        scaled = current.astype(np.float32).reshape(-1, current.shape[-1]).copy()
        if light is not None:
            scaled[:, 0] *= light[0]
        return previous.astype(np.float32).reshape(-1, previous.shape[-1]), scaled


# Two keyframes of 2 x 2 patches with two channels.
STORED = np.array([[[[3, 0], [0, 1]], [[1, 0], [0, 1]]], [[[0, 2], [0, 2]], [[4, 0], [4, 0]]]], np.float16)
MASK = np.repeat(np.repeat(np.array([[1, 1], [2, 0]], np.int32), 4, 0), 4, 1)


def embeddings(visit: int, light: Any = None) -> VisitEmbeddings:
    def features(k: int) -> np.ndarray:
        return STORED[k]

    mapped: Any = SimpleNamespace(features=(features, features), extractor=PlainExtractor())
    return VisitEmbeddings(mapped, visit, light)


def test_mask_is_embedded_by_the_mean_of_its_patches_at_length_one() -> None:
    vectors = embeddings(0).of_masks(0, MASK)
    assert set(vectors) == {1, 2}
    np.testing.assert_allclose(vectors[1], np.array([3, 1]) / np.sqrt(10), rtol=1e-6)  # (3, 0) and (0, 1)
    np.testing.assert_allclose(vectors[2], [1, 0])


def test_light_is_taken_out_of_the_current_visit_only() -> None:
    light = np.array([2.0])
    np.testing.assert_allclose(
        embeddings(1, light).of_masks(0, MASK)[1], np.array([6, 1]) / np.sqrt(37), rtol=1e-6
    )
    np.testing.assert_allclose(
        embeddings(0, light).of_masks(0, MASK)[1], np.array([3, 1]) / np.sqrt(10), rtol=1e-6
    )


def test_object_is_the_average_over_its_keyframes() -> None:
    visit: Any = SimpleNamespace(
        geometry=SimpleNamespace(keyframes=[None, None]),
        objects=SimpleNamespace(count=3, mask=lambda geometry, k: MASK),
    )
    vectors = averaged_embeddings(embeddings(0), visit)
    both = np.array([3, 1]) / np.sqrt(10) + np.array([0, 1])
    np.testing.assert_allclose(vectors[1], both / np.linalg.norm(both), rtol=1e-6)
    np.testing.assert_allclose(vectors[2], [1, 0], atol=1e-6)
    assert vectors[3].tolist() == [0, 0]  # never seen
    assert np.linalg.norm(vectors[1]) == pytest.approx(1.0)


def test_threshold_follows_from_the_features_own_scale() -> None:
    settings = Settings().override("baseline.embedding_spread", 0.2)
    mapped: Any = SimpleNamespace(extractor=PlainExtractor(), settings=settings)
    assert min_similarity(mapped) == pytest.approx(0.98)
