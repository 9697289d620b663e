from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from oasisview.assets import AssetTable
from oasisview.catalogue import Catalogue
from oasisview.panels.patch_overlay import patch_overlay, patch_words
from oasisview.patch_links import MAX_RIVALS, PatchPick, links_of_object, story_of
from pipeline.result import PatchLinks, Result


def made(seed: int = 0, shape0: tuple[int, int] = (3, 4), shape1: tuple[int, int] = (2, 5)) -> PatchLinks:
    draw = np.random.default_rng(seed)
    n0, n1 = shape0[0] * shape0[1], shape1[0] * shape1[1]
    return PatchLinks(
        draw.integers(0, n1, n0).astype(np.uint16),
        draw.random(n0).astype(np.float16),
        draw.integers(0, n0, n1).astype(np.uint16),
        draw.random(n1).astype(np.float16),
        shape0,
        shape1,
    )


def centre(patch: int, shape: tuple[int, int]) -> tuple[float, float]:
    return ((patch % shape[1]) + 0.5) / shape[1], (patch // shape[1] + 0.5) / shape[0]


@given(seed=st.integers(0, 50), session=st.integers(0, 1), u=st.floats(0, 1), v=st.floats(0, 1))
def test_a_story_is_what_the_links_hold(seed: int, session: int, u: float, v: float) -> None:
    links = made(seed)
    own, other = (links.previous_shape, links.current_shape)[:: 1 if session == 0 else -1]
    to, back = (links.forward, links.backward)[:: 1 if session == 0 else -1]
    scores = (links.forward_score, links.backward_score)[:: 1 if session == 0 else -1]
    patch = min(int(v * own[0]), own[0] - 1) * own[1] + min(int(u * own[1]), own[1] - 1)

    story = story_of(links, session, u, v)

    ends = (story.match.before, story.match.after)
    assert ends[session] == centre(patch, own) and ends[1 - session] == centre(int(to[patch]), other)
    assert story.match.score == float(scores[0][patch])
    assert story.mutual == (back[to[patch]] == patch)
    assert (story.prefers is None) == story.mutual
    claims = {q for q in np.flatnonzero(back == patch).tolist() if q != to[patch]}
    assert len(story.rivals) == min(len(claims), MAX_RIVALS)
    assert [r.score for r in story.rivals] == sorted((r.score for r in story.rivals), reverse=True)
    assert {(r.before, r.after)[1 - session] for r in story.rivals} <= {centre(q, other) for q in claims}


def test_links_of_an_object_start_on_it_and_are_the_strongest() -> None:
    links = made()
    mask = np.zeros((12, 16), bool)
    mask[:4, :8] = True  # the two left patches of the top row
    nothing = np.zeros((12, 16), bool)

    drawn = links_of_object(links, mask, nothing)
    assert {link.before for link in drawn} == {centre(0, (3, 4)), centre(1, (3, 4))}
    assert [link.score for link in drawn] == sorted(links.forward_score[:2].astype(float), reverse=True)

    drawn = links_of_object(links, nothing, np.ones((2, 5), bool), limit=3)
    assert [link.score for link in drawn] == sorted(links.backward_score.astype(float), reverse=True)[:3]
    assert links_of_object(links, nothing, nothing) == ()


def test_the_small_result_tells_a_patch_in_words(small_result: Result) -> None:
    catalogue = Catalogue(small_result, AssetTable())
    keyframe = next(k for k in range(6) if catalogue.covisible(0, k) is not None)
    pair = (keyframe, catalogue.covisible(0, keyframe).other_keyframe)
    mask = catalogue.mask(0, keyframe)
    item = max(catalogue.objects.values(), key=lambda i: int((mask == i.object_id).sum()))
    rows, columns = np.nonzero(mask == item.object_id)
    pick = PatchPick(0, pair, columns.mean() / mask.shape[1], rows.mean() / mask.shape[0])

    overlay = patch_overlay(catalogue, pair, pick, item.object_id)

    assert overlay.marks(0).count("data-link-from") == overlay.marks(1).count("data-link-to") > 1
    assert "oa-patch" in overlay.marks(0) and 'rect class="oa-patch"' not in overlay.marks(1)
    assert overlay.words().count("Best match") == 2  # shown, and whole in the tip
    assert patch_overlay(catalogue, (pair[0], pair[1] + 1), pick, None).words() == ""


def test_words_name_quality_and_rivals() -> None:
    for u in np.linspace(0, 1, 9):
        story = story_of(made(), 0, float(u), 0.5)
        said = patch_words(story, 0.5)
        assert said.startswith(f"Best match {story.match.score:.2f}")
        assert ("sure" in said) == (story.match.score >= 0.5)
        assert ("mutual" in said) == story.mutual
        assert ("No rival" in said) == (not story.rivals)
