"""Where prints were found again, object by object."""

from __future__ import annotations

import numpy as np

from pipeline.association.keypoint_registration import KeypointRegistration
from pipeline.change.prints import Prints

NOWHERE: tuple[list, list] = ([], [])


def agreement(support: float) -> KeypointRegistration:
    return KeypointRegistration(np.eye(4), 0.0, support)


def test_each_object_has_its_greatest_support_here_and_elsewhere() -> None:
    found = {(1, 1): agreement(4.0), (1, 2): agreement(7.0), (1, 3): agreement(5.0), (2, 3): agreement(1.0)}
    still = {(1, 1): True, (1, 2): False, (1, 3): False, (2, 3): False}

    previous, current = Prints(found, still, (2, 3), NOWHERE).support(np.ones(4, bool))

    assert previous.here.tolist() == [0, 4, 0]
    assert previous.elsewhere.tolist() == [0, 7, 1]
    assert current.here.tolist() == [0, 4, 0, 0]
    assert current.elsewhere.tolist() == [0, 0, 7, 5]


def test_objects_that_the_current_visit_has_not_met_yet_support_nothing() -> None:
    found, still = {(1, 1): agreement(4.0), (1, 2): agreement(7.0)}, {(1, 1): True, (1, 2): False}

    previous, current = Prints(found, still, (1, 2), NOWHERE).support(np.array([True, True, False]))

    assert (previous.here[1], previous.elsewhere[1]) == (4, 0)
    assert current.elsewhere.tolist() == [0, 0, 0]
