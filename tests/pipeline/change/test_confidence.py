"""The chance that a label is right, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.change.confidence import NO_MOVE_LOG_ODDS, confidence_features, group_of, label_confidence
from pipeline.result import ChangeLabel as L
from pipeline.settings import ConfidenceSettings

SETTINGS = ConfidenceSettings(
    static_bias=1.0,
    static_change=0.5,
    static_coverage=0.0,
    static_voxels=0.0,
    static_move=0.0,
    changed_bias=0.0,
    changed_change=0.0,
    changed_coverage=2.0,
    changed_voxels=0.5,
    changed_move=-1.0,
    moved_bias=0.0,
    moved_change=0.0,
    moved_coverage=0.0,
    moved_voxels=0.0,
    moved_move=1.0,
)


def test_features_are_limited() -> None:
    features = confidence_features(
        np.array([-20.0, 3.0]), np.array([1.2, 0.5]), np.array([100, 0]), np.array([9.0, -9.0])
    )

    assert features.tolist() == [[1, 8, 1, 2, 4], [1, 3, 0.5, 0, NO_MOVE_LOG_ODDS]]


def test_every_label_has_the_weights_of_its_group() -> None:
    labels = np.array([L.STATIC, L.UNKNOWN, L.APPEARED, L.DISAPPEARED, L.MOVED])
    assert group_of(labels).tolist() == [0, 0, 1, 1, 2]

    features = np.array([[1, 2.0, 1.0, 2.0, -4.0]] * 5)
    found = label_confidence(labels, features, SETTINGS)

    static, changed, moved = 1 + 0.5 * 2, 2 * 1 + 0.5 * 2 + 4, -4
    expected = [1 / (1 + np.exp(-z)) for z in (static, static, changed, changed, moved)]
    assert found == pytest.approx(expected)


def test_a_likely_move_makes_a_disappearance_doubtful() -> None:
    labels = np.array([L.DISAPPEARED, L.DISAPPEARED])
    features = confidence_features(
        np.array([6.0, 6.0]), np.ones(2), np.array([500, 500]), np.array([NO_MOVE_LOG_ODDS, 0.0])
    )

    alone, with_rival = label_confidence(labels, features, ConfidenceSettings())

    assert with_rival <= alone
