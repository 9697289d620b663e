"""Procedural two-visit scenes with exact ground truth."""

from pipeline.synthetic.generation import HELD_OUT_SCENES, SCENES, build_scene, generate
from pipeline.synthetic.world import SensorSettings

__all__ = ["HELD_OUT_SCENES", "SCENES", "SensorSettings", "build_scene", "generate"]
