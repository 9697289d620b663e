"""``oasisview batch``."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

from oasisview.commands.options import add_engine_options, add_json_option, positive, settings_from
from oasisview.job import Job, RunningJob, start_job
from oasisview.jobs_file import read_jobs
from pipeline.errors import InputError

NAME = "batch"
HELP = "process many pairs of visits"
DESCRIPTION = """Process every row of a CSV file with the columns previous, current, result; relative paths
start at the file's folder. Results that fit are left as they are, so the same call can be repeated. One line
a job; exit code 0 only if all are done."""


@dataclass(frozen=True)
class Outcome:
    """How one job ended; ``status`` is done, cached or failed."""

    result: str
    status: str
    seconds: float
    message: str
    exit_code: int


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("jobs", type=Path, metavar="JOBS.csv", help="columns previous,current,result")
    parser.add_argument("--engine", choices=("local", "ray"), default="local", help="where (default: local)")
    parser.add_argument("--workers", type=positive, default=1, metavar="N", help="jobs at once (default: 1)")
    parser.add_argument(
        "--overwrite", action="store_true", help="replace results of other recordings or settings"
    )
    add_json_option(parser)
    add_engine_options(parser)


def run_command(arguments: argparse.Namespace) -> int:
    """Run all jobs, print one line each."""
    jobs = read_jobs(arguments.jobs, settings_from(arguments), overwrite=arguments.overwrite)
    outcomes = _on_ray(jobs) if arguments.engine == "ray" else _locally(jobs, arguments.workers)
    codes = []
    for outcome in outcomes:
        codes.append(outcome.exit_code)
        if arguments.json:
            print(json.dumps(asdict(outcome)), flush=True)
        else:
            detail = f": {outcome.message}" if outcome.message else ""
            print(f"{outcome.status:<6} {outcome.seconds:7.1f} s  {outcome.result}{detail}", flush=True)
    failed = sum(code != 0 for code in codes)
    if failed:
        print(
            f"oasisview: {failed} of {len(jobs)} jobs failed: the same call tries them again", file=sys.stderr
        )
    return 1 if 1 in codes else max(codes)


def _outcome(running: RunningJob) -> Outcome:
    started = time.monotonic()
    state = running.wait()
    status = "failed" if state.error else "cached" if state.from_cache else "done"
    seconds = round(time.monotonic() - started, 1)
    return Outcome(str(running.job.result), status, seconds, state.error or "", state.exit_code or 0)


def _locally(jobs: Sequence[Job], workers: int) -> Iterator[Outcome]:
    """Each job is a process, which cannot take the others down with it; threads only wait for them."""
    running: list[RunningJob] = []

    def start_and_wait(job: Job) -> Outcome:
        started = start_job(job)
        running.append(started)
        return _outcome(started)

    with ThreadPoolExecutor(max_workers=workers) as pool:
        try:
            for future in as_completed([pool.submit(start_and_wait, job) for job in jobs]):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for job in running:
                job.cancel()
            raise


def _on_ray(jobs: Sequence[Job]) -> Iterator[Outcome]:
    try:
        import ray
    except ImportError:
        raise InputError("ray is not installed", "pip install ray, or use --engine local") from None
    ray.init(ignore_reinit_error=True, log_to_driver=False)
    waiting = [ray.remote(num_cpus=2)(_run_job).remote(job) for job in jobs]
    while waiting:
        finished, waiting = ray.wait(waiting, num_returns=1)
        yield ray.get(finished[0])


def _run_job(job: Job) -> Outcome:
    return _outcome(start_job(job))
