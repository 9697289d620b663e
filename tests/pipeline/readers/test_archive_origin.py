"""The place on Earth that an archive states."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from archive_writers import recording, write_nerfstudio

from pipeline.readers import open_session
from pipeline.session import GeographicOrigin


def test_origin_is_read(tmp_path: Path) -> None:
    stated = {"latitude_deg": 48.1, "longitude_deg": 11, "altitude_m": 520.5, "y_axis_azimuth_deg": -30.0}
    write_nerfstudio(tmp_path, recording(2), session={"origin": stated})
    session = open_session(tmp_path)
    assert session.origin == GeographicOrigin(48.1, 11.0, 520.5, -30.0)
    assert session.warnings == ()


def test_most_recordings_have_none(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, recording(2))
    assert open_session(tmp_path).origin is None


@pytest.mark.parametrize(
    ("stated", "complaint"),
    [
        ("Munich", "it is not an object"),
        ({"latitude_deg": 48.1}, "'longitude_deg' is missing"),
        ({"latitude_deg": "48", "longitude_deg": 11}, "'latitude_deg' is '48'"),
        ({"latitude_deg": 148.1, "longitude_deg": 11}, "are not on Earth"),
    ],
)
def test_an_origin_that_cannot_be_is_ignored_with_a_warning(
    tmp_path: Path, stated: Any, complaint: str
) -> None:
    write_nerfstudio(tmp_path, recording(2), session={"origin": stated})
    session = open_session(tmp_path)
    assert session.origin is None
    assert len(session.warnings) == 1
    assert complaint in session.warnings[0]
