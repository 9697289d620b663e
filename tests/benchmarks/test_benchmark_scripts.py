from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from fixture_result import write_small_result

from pipeline.association.moves import FEATURES
from pipeline.camera import is_rigid, rotation_angle_rad
from pipeline.change.change_score import change_features
from pipeline.change.evidence import ObjectEvidence
from pipeline.errors import InputError, ResultError
from pipeline.ply import LabelledPoints, write_ply
from pipeline.store import open_result

SCRIPTS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(autouse=True)
def _scripts_can_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(SCRIPTS)


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    folder = tmp_path / "s1"
    for name in ("images", "depth"):
        (folder / name).mkdir(parents=True)
    frames = []
    for k in range(5):
        pose = np.eye(4)
        pose[:3, 3] = [k, 10, 2]
        frames.append({"file_path": f"images/{k}.jpg", "transform_matrix": pose.tolist()})
    (folder / "transforms.json").write_text(json.dumps({"fl_x": 500, "frames": frames}))
    return folder


def poses(folder: Path) -> np.ndarray:
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    return np.array([frame["transform_matrix"] for frame in frames])


def test_an_offset_moves_the_whole_visit_by_these_amounts(archive: Path, tmp_path: Path) -> None:
    from pose_noise import disturb

    T = disturb(archive, tmp_path / "wrong", "offset", 0.02, np.radians(1), np.random.default_rng(0))
    right, wrong = poses(archive), poses(tmp_path / "wrong")
    np.testing.assert_allclose(wrong, T @ right)
    assert np.degrees(rotation_angle_rad(right[0, :3, :3], wrong[0, :3, :3])) == pytest.approx(1)
    middle = right[:, :3, 3].mean(axis=0)
    assert np.linalg.norm(T[:3, :3] @ middle + T[:3, 3] - middle) == pytest.approx(0.02)
    assert (tmp_path / "wrong" / "images").resolve() == archive / "images"


def test_jitter_moves_every_frame_on_its_own(archive: Path, tmp_path: Path) -> None:
    from pose_noise import disturb

    T = disturb(archive, tmp_path / "wrong", "jitter", 0.02, np.radians(1), np.random.default_rng(0))
    np.testing.assert_array_equal(T, np.eye(4))
    errors = np.linalg.inv(poses(archive)) @ poses(tmp_path / "wrong")
    assert all(is_rigid(error) for error in errors)
    np.testing.assert_allclose(np.linalg.norm(errors[:, :3, 3], axis=1), 0.02)
    assert len(np.unique(errors[:, 0, 3].round(6))) == 5
    disturb(archive, tmp_path / "again", "jitter", 0.02, np.radians(1), np.random.default_rng(0))
    np.testing.assert_array_equal(poses(tmp_path / "again"), poses(tmp_path / "wrong"))


def test_what_is_left_of_an_offset_is_told_at_the_middle_of_the_path(archive: Path, tmp_path: Path) -> None:
    from pose_noise import disturb, left_over

    T = disturb(archive, tmp_path / "wrong", "offset", 0.02, np.radians(1), np.random.default_rng(0))
    uncorrected = left_over({"quality": {"registration": {}}}, T, tmp_path / "wrong")
    assert uncorrected == pytest.approx((20, 1))
    undone = {"quality": {"registration": {"T_previous_current": np.linalg.inv(T).tolist()}}}
    assert left_over(undone, T, tmp_path / "wrong") == pytest.approx((0, 0), abs=1e-5)


def test_settings_are_named_in_full() -> None:
    from scene_pairs import settings_with

    assert settings_with(["change.rule=paper"]).change.rule == "paper"
    with pytest.raises(InputError, match="names no value"):
        settings_with(["change.rule"])


def test_figures_are_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from plot_methods import draw

    row = {"mean": {"change F1": 0.5}, "worst": {"change F1": None}}
    bins = [{"mean_confidence": 0.9, "accuracy": 0.8}]
    measured = {
        "means": {"oasis": {"office": row, "all": row}},
        "calibration": {"oasis": {"bins": bins, "ece": None}},
        "abstention": {"oasis": {"curve": [{"coverage": 1.0, "precision": 0.8}]}},
    }
    paths = draw(measured, tmp_path / "figures")
    assert [path.name for path in paths] == ["change_f1.png", "confidence.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


def pair_row(previous: int, current: int, **features: float) -> tuple:
    return (previous, current, *(features.get(name, 0.0) for name in FEATURES), 0.0)


def scene_with_moves(folder: Path) -> Path:
    """The small result as a scene of the fit: objects 4 and 5 moved, 1 stayed, 6 appeared, 9 is gone."""
    result = open_result(write_small_result(folder, "changes.oasis"))
    parts = []
    for session in result.sessions:
        ids = np.array(session.object_ids)
        labels = np.array([0, *(int(o.label) for o in result.objects)], np.uint8)[ids]
        points = np.array(session.points_world)
        visit = np.full(len(ids), session.index, np.uint8)
        parts.append(
            LabelledPoints(
                points, np.array(session.colours), visit, labels, ids, np.ones(len(ids), np.float32)
            )
        )
    fields = ("points_world", "colours", "session", "label", "object_id", "confidence")
    write_ply(
        folder / "gt.ply",
        LabelledPoints(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields)),
    )
    rows = [
        pair_row(4, 4, voxels=np.log(500.0), shared=0.5),
        pair_row(5, 5, voxels=np.log(500.0), shared=0.45),
        pair_row(4, 5, voxels=np.log(500.0), shared=0.1),
        pair_row(9, 6, voxels=np.log(500.0), shared=0.15),
        pair_row(1, 1, voxels=np.log(500.0), shared=0.5),  # it stayed: says nothing about moves
        pair_row(77, 4, voxels=np.log(500.0), shared=0.5),  # nobody knows what 77 was
    ]
    numbers = [("previous_object_id", "i4"), ("current_object_id", "i4")]
    table = np.array(rows, [*numbers, *((name, "f4") for name in (*FEATURES, "log_odds"))])
    np.save(folder / "changes.oasis" / "moves.npy", table, allow_pickle=False)
    return folder


def test_pairs_are_one_if_both_are_the_same_true_object_that_moved(tmp_path: Path) -> None:
    import fit_move_score

    examples = fit_move_score.read_examples(scene_with_moves(tmp_path / "hall-1"))

    truth = dict(zip(map(tuple, examples.pairs.tolist()), examples.true_object.tolist(), strict=True))
    assert truth == {(4, 4): 4, (5, 5): 5, (4, 5): 0, (9, 6): 0}
    assert examples.weight == pytest.approx(np.array([1.5, 1.5, 1, 1]))  # 2 sqrt(500 / 2000) = 1


def test_result_without_moves_cannot_be_fitted_on(tmp_path: Path) -> None:
    import fit_move_score

    folder = scene_with_moves(tmp_path / "hall-1")
    (folder / "changes.oasis" / "moves.npy").unlink()

    with pytest.raises(ResultError, match=r"holds no moves\.npy"):
        fit_move_score.read_examples(folder)


def test_fit_of_moves_finds_the_weights_that_made_the_pairs() -> None:
    import fit_move_score

    rng = np.random.default_rng(0)
    features = rng.normal(size=(4000, len(FEATURES))) * np.linspace(0.4, 2, len(FEATURES))
    features[:, FEATURES.index("voxels")] = np.log(2000)
    true = np.zeros(len(FEATURES))
    true[[0, 3, 5]] = 3.0, -1.0, 2.0
    odds = 1 / (1 + np.exp(-(-1.0 + features @ true)))
    is_one = rng.random(4000) < odds
    pairs = np.stack([np.arange(4000), np.arange(4000)], axis=1)
    examples = fit_move_score.Examples(pairs, features, is_one.astype(int) * (1 + np.arange(4000)))

    weights = fit_move_score.fit([examples])

    # Pairs that are one weigh 1.5 times: that adds its logarithm to the log odds.
    at_voxels = weights[1 + FEATURES.index("voxels")] * np.log(2000)
    assert weights[0] + at_voxels == pytest.approx(-1.0 + np.log(1.5), abs=0.2)
    others = [n for n in range(len(FEATURES)) if FEATURES[n] != "voxels"]
    assert weights[1:][others] == pytest.approx(true[others], abs=0.3)


def test_fit_of_moves_reports_every_kind_of_scene_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import fit_move_score

    folders = [scene_with_moves(tmp_path / name) for name in ("hall-1", "hall-2", "shed-1")]
    monkeypatch.setattr("sys.argv", ["fit_move_score.py", *map(str, folders)])
    monkeypatch.setattr(fit_move_score, "RIDGE", 0.01)  # there are twelve pairs only

    fit_move_score.main()

    weights, hall, shed = capsys.readouterr().out.splitlines()
    assert weights.startswith("{'bias': ")
    assert "'shared_weight': " in weights
    told = "{0} right of {0} claimed, {0} found of {0} that moved"
    assert hall == f"hall: {told.format(4)}; left out of the fit: {told.format(4)}"
    assert shed == f"shed: {told.format(2)}; left out of the fit: {told.format(2)}"


def test_fit_of_changes_knows_every_feature_of_the_score() -> None:
    from fit_change_score import NAMES

    evidence = ObjectEvidence(**{field.name: np.zeros(3) for field in dataclasses.fields(ObjectEvidence)})
    assert len(NAMES) == 1 + change_features(evidence).shape[1]
