"""Procedural two-visit scenes with exact ground truth."""

from pipeline.synthetic.generation import SCENES, build_scene, generate
from pipeline.synthetic.world import SensorSettings

__all__ = ["SCENES", "SensorSettings", "build_scene", "generate"]
