from __future__ import annotations

import pytest

from oasisview import wording
from oasisview.wording import Limits
from pipeline.result import ChangeLabel, Result

LIMITS = Limits(tau_sigma=0.3, tau_s=0.85, tau_d_m=0.1, nu_min=0.5)


def test_limits_come_from_the_result(small_result: Result) -> None:
    limits = Limits.of(small_result)
    assert limits.tau_d_m == small_result.manifest["settings"]["change"]["tau_d_m"]
    assert limits.tau_sigma == pytest.approx(small_result.score_matrix.tau_sigma)


def test_queue_facts(small_result: Result) -> None:
    facts = {item.object_id: wording.queue_fact(item, item.label) for item in small_result.objects}
    assert facts[4] == "moved 82 cm" and facts[8] == "replaced by #7" and facts[7] == "replaces #8"
    assert facts[10] == "not decided" and facts[1] == "in place"
    assert wording.queue_fact(small_result.object(8), ChangeLabel.STATIC) == "in place"


@pytest.mark.parametrize(
    ("sigma", "s_bar", "partner", "said"),
    [
        (0.06, 0.9, None, "only 6% of the patches land here (30% needed)"),
        (0.4, 0.61, None, "match poorly (0.61, at least 0.85 needed)"),
        (0.4, 0.9, 20, "but #20 fits better"),
        (0.4, 0.9, None, "belongs to another object or place"),
    ],
)
def test_rejections_name_the_limit(sigma: float, s_bar: float, partner: int | None, said: str) -> None:
    assert said in wording.rejection(sigma, s_bar, LIMITS, partner_id=partner)


def test_numbers_for_people() -> None:
    assert wording.length(0.034) == "3 cm" and wording.length(3.2) == "3.20 m"
    assert wording.duration(59.4) == "59 s" and wording.duration(61) == "1 min 01 s"
    assert wording.size((0.1, 0.5, 0.3)) == "50 x 30 x 10 cm"
    assert wording.size((0.1, 1.5, 0.3)) == "1.50 x 0.30 x 0.10 m"
