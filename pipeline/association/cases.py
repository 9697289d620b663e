"""The four cases of mask-to-mask matching (paper, Sec. III-C.2)."""

from __future__ import annotations

from pipeline.result import MatchCase


def match_case(sigma: float, s_bar: float, tau_sigma: float, tau_s: float) -> MatchCase:
    """Name the case of a pair.

    Args:
        sigma: match proportion; s_bar: mean confidence of the matches.
        tau_sigma, tau_s: the gates.
    """
    is_dense, is_sure = sigma >= tau_sigma, s_bar >= tau_s
    if is_sure:
        return MatchCase.CONFIDENT if is_dense else MatchCase.PARTIAL
    return MatchCase.LOOKALIKE if is_dense else MatchCase.NONE
