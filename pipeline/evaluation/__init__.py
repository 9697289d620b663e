"""Metrics of change maps, one per file; definitions stand in each file's docstring."""

from __future__ import annotations

from pipeline.evaluation.evaluator import evaluate, evaluate_result
from pipeline.evaluation.ground_truth import GroundTruth, Motion, read_ground_truth
from pipeline.evaluation.presets import PRESETS, PresetReport, evaluate_preset
from pipeline.evaluation.report import Report

__all__ = [
    "PRESETS",
    "GroundTruth",
    "Motion",
    "PresetReport",
    "Report",
    "evaluate",
    "evaluate_preset",
    "evaluate_result",
    "read_ground_truth",
]
