"""What speaks for a change, and what may not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.change.change_score import appearance_trust, change_features, change_log_odds
from pipeline.change.evidence import ObjectEvidence
from pipeline.settings import ChangeSettings

SETTINGS = ChangeSettings()
AGREEING = 0.1  # log units: the visits' colours agree well
OBJECTS = 21


def unchanged() -> ObjectEvidence:
    """Twenty objects that stayed, alike but for a little scatter; entry 0 is background."""
    scatter = np.linspace(-1, 1, OBJECTS)
    return ObjectEvidence(
        voxel_count=np.full(OBJECTS, 500),
        coverage=np.ones(OBJECTS),
        seen_through=np.zeros(OBJECTS),
        compared_count=np.full(OBJECTS, 400),
        median_residual=0.15 + 0.02 * scatter,
        tail_share=0.02 + 0.01 * scatter,
        texture=np.full(OBJECTS, 0.3),
        texture_correlation=0.9 + 0.03 * scatter,
        centroid_world=np.zeros((OBJECTS, 3)),
        dissimilarity=-2.2 + 0.1 * scatter,
        pattern_pixels=np.zeros(OBJECTS),
        pattern_correlation=np.full(OBJECTS, np.nan),
        print_here=np.zeros(OBJECTS),
        print_elsewhere=np.zeros(OBJECTS),
    )


def patterned() -> ObjectEvidence:
    """The unchanged objects, all of them printed, and the prints found again."""
    return replace(
        unchanged(),
        pattern_pixels=np.full(OBJECTS, 500.0),
        pattern_correlation=0.8 + 0.02 * np.linspace(-1, 1, OBJECTS),
    )


def with_object(evidence: ObjectEvidence | None = None, **values: float) -> ObjectEvidence:
    """The unchanged (or given) objects, the last of them with other values."""
    evidence = unchanged() if evidence is None else evidence
    changed = {name: getattr(evidence, name).astype(float).copy() for name in values}
    for name, value in values.items():
        changed[name][-1] = value
    return replace(evidence, **changed)


def log_odds(evidence: ObjectEvidence, scale: float = AGREEING) -> float:
    return float(change_log_odds(evidence, scale, SETTINGS)[-1])


def test_objects_that_look_as_before_have_not_changed() -> None:
    assert (change_log_odds(unchanged(), AGREEING, SETTINGS)[1:] < 0).all()


def test_a_place_seen_to_be_empty_has_changed_whatever_it_looks_like() -> None:
    assert log_odds(with_object(seen_through=0.9)) > 0
    assert log_odds(with_object(seen_through=0.9), scale=1.0) > 0


def test_another_print_on_the_same_shape_is_a_change() -> None:
    replaced = with_object(texture_correlation=0.1, tail_share=0.4, median_residual=0.5, dissimilarity=-0.5)

    assert log_odds(replaced) > 0


def test_colours_alone_do_not_make_a_change_where_patches_agree() -> None:
    # A print that is a centimetre off: voxel colours differ, patches find their match beside it.
    misaligned = with_object(texture_correlation=0.1, tail_share=0.4, median_residual=0.5, dissimilarity=-2.3)

    assert log_odds(misaligned) < 0


def test_appearance_does_not_count_where_the_visits_colours_hardly_agree() -> None:
    replaced = with_object(texture_correlation=0.1, tail_share=0.4, median_residual=0.5, dissimilarity=-0.5)

    assert log_odds(replaced, scale=0.4) == pytest.approx(SETTINGS.bias)


def test_trust_in_appearance_falls_from_full_to_none() -> None:
    middle = (SETTINGS.full_appearance_scale + SETTINGS.no_appearance_scale) / 2

    assert appearance_trust(SETTINGS.full_appearance_scale, SETTINGS) == 1
    assert appearance_trust(middle, SETTINGS) == pytest.approx(0.5)
    assert appearance_trust(SETTINGS.no_appearance_scale, SETTINGS) == 0


def test_few_compared_voxels_say_little() -> None:
    values = dict(texture_correlation=0.1, tail_share=0.4, median_residual=0.5, dissimilarity=-0.5)

    assert log_odds(with_object(**values, compared_count=5)) < 0 < log_odds(with_object(**values))


def test_what_was_never_compared_is_judged_by_geometry_alone() -> None:
    features = change_features(with_object(compared_count=0, dissimilarity=np.nan, seen_through=0.2))

    assert features[-1].tolist() == [0.2, 0, 0, 0, 0, 0, 0, 0]


def test_a_lost_pattern_is_a_change_however_the_visits_colours_agree() -> None:
    lost = with_object(patterned(), pattern_correlation=0.1)

    assert (change_log_odds(patterned(), AGREEING, SETTINGS)[1:] < 0).all()
    assert log_odds(lost) > 0
    # Without trust in colours the pattern alone is left; its weight is not damped.
    pattern = change_features(lost)[-1, 5]
    assert log_odds(lost, scale=1.0) == pytest.approx(SETTINGS.bias + SETTINGS.pattern_weight * pattern)


def test_a_print_found_again_here_speaks_against_a_change_and_elsewhere_for_one() -> None:
    here, elsewhere = with_object(print_here=9.0), with_object(print_elsewhere=9.0)

    nothing = log_odds(unchanged())
    # log(1 + 9 places), whether the visits' colours agree or not.
    assert log_odds(here) - nothing == pytest.approx(SETTINGS.print_here_weight * np.log(10))
    assert log_odds(elsewhere, 1.0) - log_odds(unchanged(), 1.0) == pytest.approx(
        SETTINGS.print_elsewhere_weight * np.log(10)
    )
    assert log_odds(here) < nothing < log_odds(elsewhere)


def test_log_odds_rise_as_the_pattern_is_lost() -> None:
    odds = [log_odds(with_object(patterned(), pattern_correlation=c)) for c in (0.9, 0.7, 0.5, 0.3, 0.1)]

    assert (np.diff(odds) > 0).all()


def test_few_pattern_pixels_say_little_and_none_nothing() -> None:
    features = [
        change_features(with_object(patterned(), pattern_correlation=0.1, pattern_pixels=pixels))[-1, 5]
        for pixels in (0.0, 20.0, 500.0)
    ]

    assert features[0] == 0 < features[1] < features[2] / 2


def test_colours_may_speak_where_the_pattern_is_lost_though_patches_agree() -> None:
    colours = dict(texture_correlation=0.1, tail_share=0.4, median_residual=0.5, dissimilarity=-2.3)
    kept = change_features(with_object(patterned(), **colours))[-1]
    lost = change_features(with_object(patterned(), **colours, pattern_correlation=0.1))[-1]

    assert (lost[2:5] > kept[2:5] + 1).all()


@pytest.mark.parametrize(
    ("name", "column", "noise"), [("dissimilarity", 1, 2.0), ("median_residual", 2, 0.3)]
)
def test_noise_of_the_visits_widens_the_spread(name: str, column: int, noise: float) -> None:
    # The same deviation of the last object is worth less where all others scatter widely.
    quiet = unchanged()
    centre = float(np.median(getattr(quiet, name)))
    noisy = replace(quiet, **{name: centre + noise * np.linspace(-1, 1, OBJECTS)})
    far = {name: centre + 2 * noise}

    # The features are cut off from above by what the patches allow; unlike patches allow them all.
    allowed = {} if name == "dissimilarity" else {"dissimilarity": 3.0}
    values = [change_features(with_object(e, **{**allowed, **far}))[-1, column] for e in (quiet, noisy)]

    assert 0 < values[1] < 0.9 * values[0]


def test_pattern_spread_never_widens() -> None:
    # A pose error blurs all patterns; were it to widen the spread, lost ones would not stand out any more.
    middle = np.arctanh(0.8)
    wide = replace(patterned(), pattern_correlation=np.tanh(middle + 0.9 * np.linspace(-1, 1, OBJECTS)))

    values = [
        change_features(with_object(e, pattern_correlation=np.tanh(middle - 0.6)))[-1, 5]
        for e in (patterned(), wide)
    ]

    assert values[1] == pytest.approx(values[0], rel=0.1)


def test_the_stored_table_gives_the_same_log_odds_again() -> None:
    evidence = with_object(texture_correlation=0.1, tail_share=0.4, median_residual=0.5, dissimilarity=-0.5)
    odds = change_log_odds(evidence, AGREEING, SETTINGS)
    table = evidence.table(log_odds=odds)

    assert change_log_odds(ObjectEvidence.from_table(table), AGREEING, SETTINGS)[1:] == pytest.approx(
        odds[1:], abs=1e-4
    )
    assert table["log_odds"] == pytest.approx(odds[1:], abs=1e-5)
