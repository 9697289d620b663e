"""Metrics of change maps, one per file; definitions stand in each file's docstring."""

from __future__ import annotations

from pipeline.evaluation.evaluator import evaluate, evaluate_result
from pipeline.evaluation.report import Report

__all__ = ["Report", "evaluate", "evaluate_result"]
