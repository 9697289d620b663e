"""Annotations of 3RScan, on a tiny scene written here in the real format."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.camera import invert_rigid, transform_points
from pipeline.errors import InputError
from pipeline.evaluation.ground_truth import read_ground_truth
from pipeline.evaluation.threerscan_files import column_major, read_rescan, read_scan
from pipeline.evaluation.threerscan_truth import (
    MoveThreshold,
    ThreeRScanSettings,
    threerscan_truth,
    write_truth,
)
from pipeline.ply import NOT_SCORED
from pipeline.result import ChangeLabel

REFERENCE, RESCAN = "531cff08-0021-28f6-8e08-ba2eeb945e09", "531cff10-0021-28f6-8f94-80db8fdbbbee"
STATIC, APPEARED, DISAPPEARED, MOVED = (
    ChangeLabel.STATIC,
    ChangeLabel.APPEARED,
    ChangeLabel.DISAPPEARED,
    ChangeLabel.MOVED,
)
FLOOR = 1
# The rescan's own frame is far off the reference's and turned.
OFFSET = np.array([[0.0, -1, 0, 4], [1, 0, 0, -3], [0, 0, 1, 0.5], [0, 0, 0, 1]])  # reference -> rescan


def turned(degrees: float, shift=(0.0, 0.0, 0.0), about=(0.0, 0.0, 0.0)) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    T = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    centre = np.array(about)
    T[:3, 3] = centre - T[:3, :3] @ centre + shift
    return T


def stored(T: np.ndarray) -> list[float]:
    """Column by column, as in 3RScan.json."""
    return T.flatten(order="F").tolist()


def blob(centre, count=60) -> np.ndarray:
    return np.array(centre) + np.random.default_rng(3).uniform(-0.1, 0.1, (count, 3))


def floor(width: float) -> np.ndarray:
    x, y = np.meshgrid(np.arange(0, width, 0.2), np.arange(0, 4, 0.2))
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)


def write_scan(folder: Path, parts: dict[int, np.ndarray], names: dict[int, str]) -> None:
    folder.mkdir(parents=True)
    groups = [{"id": i, "objectId": i, "label": name, "segments": [i]} for i, name in names.items()]
    (folder / "semseg.v2.json").write_text(json.dumps({"scan_id": folder.name, "segGroups": groups}))
    rows = [f"{x:.6f} {y:.6f} {z:.6f} 10 20 30 {i} 6 1 2 3" for i, p in parts.items() for x, y, z in p]
    header = [
        "ply",
        "format ascii 1.0",
        f"element vertex {len(rows)}",
        *(f"property float {name}" for name in "xyz"),
        *(f"property uchar {name}" for name in ("red", "green", "blue")),
        "property ushort objectId",
        "property ushort globalId",
        *(f"property uchar {name}" for name in ("NYU40", "Eigen13", "RIO27")),
        "element face 1",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    text = "\n".join([*header, *rows, "3 0 1 2"]) + "\n"
    (folder / "labels.instances.annotated.v2.ply").write_text(text)


class Scene:
    """Two scans of a floor with things on it; ``write`` puts the dataset's files down."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.before: dict[int, np.ndarray] = {FLOOR: floor(4)}
        self.after: dict[int, np.ndarray] = {FLOOR: floor(4)}  # in the reference's frame
        self.names = [{FLOOR: "floor"}, {FLOOR: "floor"}]
        self.rigid: list = []
        self.removed: list = []
        self.nonrigid: list = []
        self.ambiguity: list = []
        self.type = "train"

    def stays(self, number: int, centre) -> None:
        self.goes(number, centre)
        self.comes(number, centre)

    def goes(self, number: int, centre) -> None:
        self.before[number] = blob(centre)
        self.names[0][number] = "box"

    def comes(self, number: int, centre) -> None:
        self.after[number] = blob(centre)
        self.names[1][number] = "box"

    def moves(self, number: int, centre, motion: np.ndarray, symmetry=0, becomes: int | None = None) -> None:
        self.goes(number, centre)
        there = number if becomes is None else becomes
        self.after[there] = transform_points(motion, self.before[number])
        self.names[1][there] = "box"
        self.rigid.append(
            {
                "instance_reference": number,
                "instance_rescan": there,
                "symmetry": symmetry,
                "transform": stored(OFFSET @ motion),
            }
        )

    def write(self) -> Path:
        write_scan(self.root / REFERENCE, self.before, self.names[0])
        own = {i: transform_points(OFFSET, points) for i, points in self.after.items()}
        write_scan(self.root / RESCAN, own, self.names[1])
        scan = {
            "reference": RESCAN,
            "transform": stored(invert_rigid(OFFSET)),
            "rigid": self.rigid,
            "nonrigid": self.nonrigid,
            "removed": self.removed,
        }
        index = [
            {"reference": "other", "type": "train", "ambiguity": [], "scans": []},
            {"reference": REFERENCE, "type": self.type, "ambiguity": self.ambiguity, "scans": [scan]},
        ]
        (self.root / "3RScan.json").write_text(json.dumps(index))
        return self.root / "3RScan.json"

    def truth(self, settings: ThreeRScanSettings | None = None):
        return threerscan_truth(self.write(), self.root, RESCAN, settings)


@pytest.fixture
def scene(tmp_path) -> Scene:
    return Scene(tmp_path / "3RScan")


def labels_of(truth, object_id: int) -> list[set[int]]:
    points = truth.points
    mine = points.object_id == object_id
    return [set(points.label[mine & (points.session == visit)].tolist()) for visit in (0, 1)]


def test_matrices_are_column_major_and_the_move_is_the_objects_not_the_frames(scene):
    motion = turned(30, (0.4, 0.2, 0), about=(1, 1, 0))
    scene.moves(5, (1, 1, 0.1), motion)
    truth = scene.truth()
    assert labels_of(truth, 5) == [{MOVED}, {MOVED}]
    np.testing.assert_allclose(truth.motions[5].T_world_motion, motion, atol=1e-6)
    points = truth.points
    before, after = (points.points_world[(points.object_id == 5) & (points.session == v)] for v in (0, 1))
    np.testing.assert_allclose(transform_points(motion, before), after, atol=1e-5)


def test_the_offset_between_scan_frames_is_no_move(scene):
    scene.moves(5, (1, 1, 0.1), np.eye(4))
    truth = scene.truth()
    assert labels_of(truth, 5) == [{STATIC}, {STATIC}]
    assert labels_of(truth, 0) == [{STATIC}, {STATIC}]


@pytest.mark.parametrize(
    ("motion", "label"),
    [
        (turned(0, (0.04, 0, 0)), STATIC),
        (turned(0, (0.06, 0, 0)), MOVED),
        (turned(0.8, about=(1, 1, 0)), STATIC),
        (turned(1.2, about=(1, 1, 0)), MOVED),
    ],
)
def test_a_rigid_entry_is_a_move_beyond_five_centimetres_or_one_degree(scene, motion, label):
    scene.moves(5, (1, 1, 0.1), motion)
    truth = scene.truth()
    assert labels_of(truth, 5) == [{label}, {label}]
    assert 5 in truth.motions


def test_the_shift_is_measured_at_the_instance_not_at_the_origin(scene):
    # About its own middle, 3 m from the origin: the matrix shifts by 4.6 cm, the instance does not.
    scene.moves(5, (3, 3, 0.1), turned(0.9, about=(3, 3, 0)))
    assert labels_of(scene.truth(), 5) == [{STATIC}, {STATIC}]


def test_the_threshold_has_a_name_and_can_be_chosen(scene):
    assert (MoveThreshold().translation_m, MoveThreshold().rotation_deg) == (0.05, 1.0)
    scene.moves(5, (1, 1, 0.1), turned(0, (0.3, 0, 0)))
    truth = scene.truth(ThreeRScanSettings(MoveThreshold(0.5, 5.0)))
    assert labels_of(truth, 5) == [{STATIC}, {STATIC}]


@pytest.mark.parametrize(
    ("symmetry", "degrees", "label", "order"),
    [
        (0, 180, MOVED, 1),
        (1, 180, STATIC, 2),
        (1, 90, MOVED, 2),
        (2, 90, STATIC, 4),
        (2, 45, MOVED, 4),
        (3, 37, STATIC, 0),
    ],
)
def test_a_turn_by_the_symmetry_is_no_move(scene, symmetry, degrees, label, order):
    scene.moves(5, (1, 1, 0.1), np.eye(4), symmetry)
    centre = scene.before[5].mean(axis=0)
    motion = turned(degrees, about=centre)
    scene.after[5] = transform_points(motion, scene.before[5])
    scene.rigid[0]["transform"] = stored(OFFSET @ motion)
    truth = scene.truth()
    assert labels_of(truth, 5) == [{label}, {label}]
    assert truth.motions[5].symmetry_order == order


def test_an_instance_may_have_another_id_in_the_rescan(scene):
    scene.moves(7, (1, 1, 0.1), turned(0, (0.5, 0, 0)), becomes=12)
    scene.goes(12, (3, 1, 0.1))  # another thing of that number stood in the reference
    scene.comes(7, (3, 3, 0.1))  # and the rescan gives 7 to something new
    truth = scene.truth()
    assert labels_of(truth, 7) == [{MOVED}, {MOVED}]
    assert labels_of(truth, 12) == [{DISAPPEARED}, set()]
    assert labels_of(truth, 13) == [set(), {APPEARED}]


def test_what_appeared_is_found_without_a_list_and_what_was_removed_without_being_listed(scene):
    scene.goes(3, (1, 1, 0.1))
    scene.goes(4, (1, 3, 0.1))
    scene.removed = [3]
    scene.comes(9, (3, 3, 0.1))
    truth = scene.truth()
    assert labels_of(truth, 3) == labels_of(truth, 4) == [{DISAPPEARED}, set()]
    # 9 was free in the reference: what only the rescan has is counted on from its last id.
    assert labels_of(truth, 5) == [set(), {APPEARED}]


def test_an_unlisted_absence_counts_only_where_the_other_scan_looked(scene):
    scene.after[FLOOR] = floor(2)  # the rescan is partial
    scene.goes(3, (3.2, 1, 0.1))
    scene.goes(4, (3.2, 3, 0.1))
    scene.removed = ["4"]  # ids may be strings
    truth = scene.truth()
    assert labels_of(truth, 3) == [{NOT_SCORED}, set()]
    assert labels_of(truth, 4) == [{DISAPPEARED}, set()]
    assert labels_of(truth, 0) == [{STATIC, NOT_SCORED}, {STATIC}]


def test_a_list_that_contradicts_the_meshes_and_changed_shapes_are_not_scored(scene):
    scene.stays(3, (1, 1, 0.1))
    scene.stays(4, (1, 3, 0.1))
    scene.stays(5, (3, 3, 0.1))
    scene.removed, scene.nonrigid = [3], [4]
    truth = scene.truth()
    assert labels_of(truth, 3) == labels_of(truth, 4) == [{NOT_SCORED}, {NOT_SCORED}]
    assert labels_of(truth, 5) == [{STATIC}, {STATIC}]


def test_a_look_alike_that_took_anothers_place_is_not_scored(scene):
    scene.moves(3, (1, 1, 0.1), turned(0, (2, 0, 0)))  # to where 4 stood
    scene.moves(4, (3, 1, 0.1), turned(0, (0, 2, 0)))  # to a free place
    pair = {"instance_source": 3, "instance_target": 4, "transform": stored(np.eye(4))}
    scene.ambiguity = [[pair]]
    truth = scene.truth()
    assert labels_of(truth, 3) == [{NOT_SCORED}, {NOT_SCORED}] and 3 not in truth.motions
    assert labels_of(truth, 4) == [{MOVED}, {MOVED}]


def test_structure_is_background(scene):
    truth = scene.truth()
    assert set(truth.points.object_id.tolist()) == {0}
    assert labels_of(truth, 0) == [{STATIC}, {STATIC}]


def test_the_test_split_lists_bare_integers_and_has_no_labels(scene):
    scene.moves(5, (1, 1, 0.1), turned(0, (0.5, 0, 0)))
    scene.rigid, scene.type = [5, 6], "test"
    index = scene.write()
    rescan = read_rescan(index, RESCAN)
    assert [entry.reference_id for entry in rescan.rigid] == [5, 6]
    assert all(entry.T_rescan_reference is None for entry in rescan.rigid)
    with pytest.raises(InputError, match="of the test split: its moves have no transforms"):
        threerscan_truth(index, scene.root, RESCAN)


def test_missing_files_and_wrong_matrices_are_said_in_one_line(scene, tmp_path):
    scene.moves(5, (1, 1, 0.1), turned(20, (0.5, 0, 0)))
    index = scene.write()
    with pytest.raises(InputError, match="lists no rescan nowhere"):
        read_rescan(index, "nowhere")
    with pytest.raises(InputError, match="is a reference scan"):
        read_rescan(index, REFERENCE)
    with pytest.raises(InputError, match="column-major"):
        column_major((OFFSET @ turned(20)).flatten().tolist(), "row by row")
    with pytest.raises(InputError, match="must be in metres"):
        column_major(stored(turned(0, (4000, 3000, 500))), "millimetres")
    with pytest.raises(InputError, match="16 numbers"):
        column_major([1, 2, 3], "short")
    labelled = scene.root / RESCAN / "labels.instances.annotated.v2.ply"
    whole = labelled.read_text()
    labelled.write_text(whole.replace("format ascii", "format binary_little_endian"))
    with pytest.raises(InputError, match="v2 is ASCII"):
        read_scan(labelled.parent)
    labelled.write_text(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"truncated|not a labelled mesh"):
        read_scan(labelled.parent)
    labelled.unlink()
    with pytest.raises(InputError, match="test split are not annotated") as caught:
        threerscan_truth(index, scene.root, RESCAN)
    assert "\n" not in str(caught.value)


def test_the_script_writes_what_the_evaluation_reads(scene, tmp_path):
    motion = turned(30, (0.4, 0.2, 0))
    scene.moves(5, (1, 1, 0.1), motion, symmetry=2)
    index = scene.write()
    call = [sys.executable, "benchmarks/threerscan_truth.py", index, scene.root, RESCAN, tmp_path / "gt"]
    done = subprocess.run(call, capture_output=True, text=True, check=True, env={"PYTHONPATH": "."})
    assert "moved: 1 objects, 120 points" in done.stdout and "0.05 m or 1.0 degrees" in done.stdout
    truth = read_ground_truth(tmp_path / "gt" / "gt.ply")
    np.testing.assert_allclose(truth.motions[5].T_world_motion, motion, atol=1e-6)
    assert truth.motions[5].symmetry_order == 4
    write_truth(tmp_path / "again", truth)
    assert (tmp_path / "again" / "gt.json").read_text() == (tmp_path / "gt" / "gt.json").read_text()
