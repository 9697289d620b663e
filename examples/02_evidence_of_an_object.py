"""Why was it decided so? The evidence behind one object of a finished result.

python examples/02_evidence_of_an_object.py changes.oasis 12
"""

import sys

import numpy as np

import pipeline


def main(path: str, object_id: int) -> None:
    result = pipeline.open_result(path)
    found = result.object(object_id)
    print(f"#{object_id}: {found.label.name.lower()}, confidence {found.confidence:.2f}")
    print(f"  coverage {found.coverage:.2f}, seen through {found.seen_through:.2f}, case {found.case}")
    scores = result.score_matrix
    for sighting in found.sightings:
        rows, ids = (
            (scores.sigma, scores.column_object_ids)
            if sighting.session == 0
            else (scores.sigma_backward.T, scores.row_object_ids)
        )
        proportions = rows[sighting.instance]
        print(f"  visit {sighting.session}: {sighting.point_count} voxels, its patches land on")
        for other in np.argsort(-proportions, kind="stable")[:3]:
            if proportions[other] > 0:
                print(f"    #{ids[other]}: {proportions[other]:.0%} of them")
    column = [other.object_id for other in result.objects].index(object_id)
    print(f"  believed after each submap: {result.belief[:, column].tolist()} (255 = not met yet)")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]))
