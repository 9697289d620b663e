"""Correct a label as an inspector would, then export the change map with the correction applied.

python examples/03_override_and_export.py changes.oasis 12 static "still there, behind the plant" out.csv
"""

import sys
from pathlib import Path

import pipeline
from oasisview.export import export
from oasisview.review import Journal
from pipeline.result import ChangeLabel


def main(path: str, object_id: int, label: str, why: str, output: Path) -> None:
    journal = Journal.of(pipeline.open_result(path))
    journal.decide(object_id, ChangeLabel[label.upper()], who="example", why=why)
    journal.close()
    export(Path(path), output.suffix.lstrip("."), output)
    print(f"#{object_id} is {label} now; {output} is written (undo in the viewer: U)")


if __name__ == "__main__":
    if len(sys.argv) != 6:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4], Path(sys.argv[5]))
