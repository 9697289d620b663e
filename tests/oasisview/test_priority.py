from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview.priority import impact_m, priority, size_m
from pipeline.result import MapObject, Result, Sighting


@pytest.fixture
def item(small_result: Result) -> MapObject:
    return small_result.object(6)


def sized(item: MapObject, *extents: tuple[float, float, float]) -> MapObject:
    places = tuple(
        Sighting(i, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), extent, 10, 1.0, ())
        for i, extent in enumerate(extents)
    )
    return replace(item, sightings=places)


def test_the_formula_by_hand(item: MapObject) -> None:
    cube = replace(sized(item, (0.5, 0.5, 0.5)), confidence=0.6, coverage=0.5)
    assert size_m(cube) == pytest.approx(0.5)
    assert impact_m(cube) == pytest.approx(0.375)
    assert priority(cube) == pytest.approx(0.15)
    assert size_m(sized(item, (2.0, 1.0, 0.5))) == pytest.approx(1.0)
    assert size_m(sized(item, (0.1, 0.1, 0.1), (0.3, 0.3, 0.3))) == pytest.approx(0.3)  # the larger visit


def test_flat_and_bare_objects_have_a_size(item: MapObject) -> None:
    assert size_m(sized(item, (1.0, 1.0, 0.0))) == pytest.approx(0.01 ** (1 / 3))
    assert size_m(replace(item, sightings=())) == pytest.approx(0.01)


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0.02, 10))
def test_more_doubt_more_coverage_and_more_size_never_rank_lower(
    confidence: float, less: float, coverage: float, side: float
) -> None:
    base = sized(ITEM, (side, side, side))
    low = replace(base, confidence=max(confidence, less), coverage=min(coverage, less))
    high = replace(base, confidence=min(confidence, less), coverage=max(coverage, less))
    assert 0 <= priority(low) <= priority(high)
    assert priority(low) <= priority(replace(sized(ITEM, (side, side, 2 * side)), confidence=low.confidence,
                                             coverage=low.coverage))  # fmt: skip


def _any_item() -> MapObject:
    from oasisview.review.machine_map import _bare_object
    from pipeline.result import ChangeLabel

    return _bare_object(1, ChangeLabel.APPEARED)


ITEM = _any_item()
