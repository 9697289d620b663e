from __future__ import annotations

import dataclasses
import json
import math

import pytest

from pipeline.errors import InputError
from pipeline.settings import Settings


def test_defaults_are_the_papers_where_the_paper_has_one() -> None:
    settings = Settings()

    keyframes = settings.keyframes
    assert (keyframes.sensor_translation_m, keyframes.sensor_rotation_deg) == (0.5, 20.0)
    assert (keyframes.learned_translation_m, keyframes.learned_rotation_deg) == (1.0, 30.0)
    assert keyframes.submap_size == 10
    assert settings.change.nu_min == 0.5


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("keyframes.submap_size", "5", 5),
        ("keyframes.submap_size", 5.0, 5),
        ("association.tau_s", "0.9", 0.9),
        ("association.tau_s", 1, 1.0),
        ("keyframes.select", "off", False),
        ("keyframes.select", "True", True),
        ("keyframes.select", False, False),
        ("change.rule", "paper", "paper"),
        ("perception.masks", "embedded", "embedded"),
    ],
)
def test_override_converts_to_the_settings_type(name: str, text: object, value: object) -> None:
    changed = Settings().override(name, text)
    section, setting = name.split(".")

    got = getattr(getattr(changed, section), setting)
    assert got == value
    assert type(got) is type(value)


def test_override_leaves_the_original_and_everything_else_alone() -> None:
    settings = Settings()
    changed = settings.override("change.tau_d_m", 0.25)

    assert settings.change.tau_d_m == Settings().change.tau_d_m
    assert changed.override("change.tau_d_m", settings.change.tau_d_m) == settings


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("keyframes.submap_size", "ten", "number of type int"),
        ("keyframes.submap_size", "2.5", "number of type int"),
        ("keyframes.submap_size", 2.5, "whole number"),
        ("keyframes.submap_size", None, "number of type int"),
        ("keyframes.submap_size", math.inf, "number"),
        ("keyframes.submap_size", 0, "at least 1"),
        ("image.geometry_stride", "0", "at least 1"),
        ("surface.voxel_size_m", -0.1, "at least 0"),
        ("association.tau_s", "high", "number of type float"),
        ("association.tau_s", "nan", "finite"),
        ("association.tau_s", math.inf, "finite"),
        ("keyframes.select", "perhaps", "true or false"),
        ("change.rule", "mine", "evidence, paper"),
        ("nothing.there", 1, "no setting 'nothing.there'"),
        ("image.nothing", 1, "no setting 'image.nothing'"),
        ("image", 1, "no setting 'image'"),
        ("image.", 1, "no setting"),
        (".max_width", 1, "no setting"),
        ("image.__doc__", "x", "no setting 'image.__doc__'"),
        ("to_dict.__name__", "x", "no setting 'to_dict.__name__'"),
    ],
)
def test_wrong_overrides_are_one_line_that_names_the_setting(name: str, value: object, says: str) -> None:
    with pytest.raises(InputError) as caught:
        Settings().override(name, value)

    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_settings_survive_json() -> None:
    settings = Settings().override("association.tau_sigma", 0.45).override("change.rule", "paper")

    assert Settings.from_dict(json.loads(json.dumps(settings.to_dict()))) == settings


def test_missing_values_keep_their_default() -> None:
    assert Settings.from_dict({}) == Settings()
    assert Settings.from_dict({"image": {"max_width": 320}}) == Settings().override("image.max_width", 320)


@pytest.mark.parametrize(
    "values", [{"unknown": {}}, {"unknown": {"a": 1}}, {"image": 3}, {"image": {"a": 1}}]
)
def test_settings_of_another_shape_are_refused(values: dict) -> None:
    with pytest.raises(InputError):
        Settings.from_dict(values)


def test_every_setting_says_what_it_is() -> None:
    for section in dataclasses.fields(Settings):
        for entry in dataclasses.fields(section.default_factory):
            assert entry.metadata["help"], f"{section.name}.{entry.name}"
            unit_by_name = {"_m": "m", "_deg": "deg", "_px": "px", "_s": "s"}
            for ending, unit in unit_by_name.items():
                if entry.name.endswith(ending) and not entry.name.endswith("tau_s"):
                    assert entry.metadata["unit"] == unit, f"{section.name}.{entry.name}"
