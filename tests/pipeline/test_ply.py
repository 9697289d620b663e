import numpy as np
import pytest

from pipeline.errors import InputError, StorageError
from pipeline.ply import LabelledPoints, read_ply, write_ply


def points(count: int = 7) -> LabelledPoints:
    rng = np.random.default_rng(3)
    return LabelledPoints(
        points_world=rng.normal(size=(count, 3)).astype(np.float32),
        colours=rng.integers(0, 256, (count, 3), dtype=np.uint8),
        session=rng.integers(0, 2, count, dtype=np.uint8),
        label=rng.choice(np.array([1, 2, 3, 4, 255], dtype=np.uint8), count),
        object_id=rng.integers(0, 1 << 20, count, dtype=np.int32),
        confidence=rng.random(count).astype(np.float32),
    )


@pytest.mark.parametrize("count", [0, 1, 7])
def test_points_come_back_exactly(tmp_path, count):
    written = points(count)
    write_ply(tmp_path / "points.ply", written)
    read = read_ply(tmp_path / "points.ply")
    for name in written.__dataclass_fields__:
        expected, got = getattr(written, name), getattr(read, name)
        assert got.dtype == expected.dtype
        np.testing.assert_array_equal(got, expected)
    assert [entry.name for entry in tmp_path.iterdir()] == ["points.ply"]


def test_the_header_is_the_contract(tmp_path):
    write_ply(tmp_path / "points.ply", points(2))
    header, _, body = (tmp_path / "points.ply").read_bytes().partition(b"end_header\n")
    assert header.decode().splitlines() == [
        "ply",
        "format binary_little_endian 1.0",
        "element vertex 2",
        *(f"property float {name}" for name in "xyz"),
        *(f"property uchar {name}" for name in ("red", "green", "blue", "session", "label")),
        "property int object_id",
        "property float confidence",
    ]
    assert len(body) == 2 * 25


def test_another_library_reads_it(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    written = points(5)
    write_ply(tmp_path / "points.ply", written)
    cloud = trimesh.load(tmp_path / "points.ply")
    np.testing.assert_allclose(cloud.vertices, written.points_world, atol=1e-6)


def test_properties_in_another_order_with_extras(tmp_path):
    dtype = np.dtype([("label", "u1"), ("z", "<f8"), ("quality", "<i2"), ("y", "<f8"), ("x", "<f8")])
    dtype = np.dtype([*((n, dtype[n].str) for n in dtype.names), ("object_id", "<i4")])
    record = np.array([(4, 3.0, 9, 2.0, 1.0, 12)], dtype=dtype)
    lines = ["ply", "format binary_little_endian 1.0", "comment hand made", "element vertex 1"]
    lines += ["property uchar label", "property double z", "property short quality"]
    lines += ["property double y", "property float64 x", "property int32 object_id", "end_header"]
    (tmp_path / "points.ply").write_bytes(("\n".join(lines) + "\n").encode() + record.tobytes())
    read = read_ply(tmp_path / "points.ply")
    np.testing.assert_array_equal(read.points_world, [[1, 2, 3]])
    assert (read.label[0], read.object_id[0], read.session[0], read.confidence[0]) == (4, 12, 0, 1.0)


def test_bad_files_are_named_in_one_line(tmp_path):
    write_ply(tmp_path / "whole.ply", points(5))
    whole = (tmp_path / "whole.ply").read_bytes()
    bad = {
        "truncated": whole[:-3],
        "no PLY": b"hello",
        "ascii": whole.replace(b"binary_little_endian", b"ascii"),
        "endless": b"ply\n" + b"comment x\n" * 500,
        "unlabelled": whole.replace(b" label\n", b" lebal\n"),
        "empty": b"",
    }
    for name, content in bad.items():
        path = tmp_path / f"{name}.ply"
        path.write_bytes(content)
        with pytest.raises(InputError, match=name) as caught:
            read_ply(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no file"):
        read_ply(tmp_path / "missing.ply")


def test_an_unwritable_place_leaves_nothing(tmp_path):
    with pytest.raises(StorageError, match="cannot write"):
        write_ply(tmp_path / "missing" / "points.ply", points())


def test_shapes_are_checked():
    good = points(3)
    with pytest.raises(ValueError, match=r"label: expected \(3,\), got \(2,\)"):
        LabelledPoints(**{**good.__dict__, "label": good.label[:2]})
