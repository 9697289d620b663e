"""The table of a batch: a CSV file with the columns previous, current, result."""

from __future__ import annotations

import csv
from pathlib import Path

from oasisview.job import Job
from pipeline.errors import InputError
from pipeline.settings import Settings

COLUMNS = ("previous", "current", "result")


def read_jobs(path: Path, settings: Settings, *, overwrite: bool = False) -> list[Job]:
    """Jobs of a CSV file; relative paths start at its folder.

    Raises:
        InputError: the file cannot be read, lacks a column, has an empty cell, or names a result twice.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except FileNotFoundError:
        raise InputError(f"there is no file {path}", "check the path") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read {path} ({error})", "it has to be a CSV file in UTF-8") from None
    if not rows:
        raise InputError(
            f"{path} names no jobs", f"its first line is {','.join(COLUMNS)}, then one line a pair"
        )
    missing = [column for column in COLUMNS if column not in rows[0]]
    if missing:
        raise InputError(
            f"{path} has no column {', '.join(missing)}", f"its first line is {','.join(COLUMNS)}"
        )
    jobs: list[Job] = []
    for number, row in enumerate(rows, start=2):
        cells = [(row[column] or "").strip() for column in COLUMNS]
        if not all(cells):
            raise InputError(f"line {number} of {path} has an empty cell", "give all three columns")
        previous, current, result = (path.parent / cell for cell in cells)
        if any(job.result == result for job in jobs):
            raise InputError(f"line {number} of {path} names {result} again", "give each pair its own result")
        jobs.append(Job(previous, current, result, settings, overwrite))
    return jobs
