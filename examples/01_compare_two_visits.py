"""Compare two visits of a place and list what changed.

    python examples/01_compare_two_visits.py PREVIOUS CURRENT changes.oasis

Without recordings of your own: ``oasisview generate office pair --seed 1``, then ``pair/s0 pair/s1``.
"""

import sys
from pathlib import Path

import pipeline
from pipeline.progress import ProgressEvent, Warned
from pipeline.result import ChangeLabel


def report(event: ProgressEvent | Warned) -> None:
    if isinstance(event, Warned):
        print(f"warning: {event.message}", file=sys.stderr)
    elif event.done == event.total:
        print(f"{event.stage}: done", file=sys.stderr)


def main(previous: Path, current: Path, output: Path) -> None:
    result = pipeline.run(previous, current, output=output, report=report)
    for found in result.objects:
        if found.label in (ChangeLabel.STATIC, ChangeLabel.UNKNOWN):
            continue
        place = ", ".join(f"{metres:.2f}" for metres in found.sightings[-1].centroid_world_m)
        distance = f", {found.displacement_m:.2f} m away" if found.label is ChangeLabel.MOVED else ""
        print(f"#{found.object_id} {found.label.name.lower()} at ({place}) m{distance}")
    for event in result.replaced:
        print(f"#{event.disappeared_id} was replaced by #{event.appeared_id}")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
