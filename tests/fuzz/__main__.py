"""The command `python -m tests.fuzz`, which runs campaigns (CONTRIBUTING.md)."""

from __future__ import annotations

import argparse
import atexit
import multiprocessing
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from textwrap import indent

sys.path[0:0] = [str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "", "generated")]

from fuzz.runner import NAMES, SEED, Failure, find, indices_of, run  # noqa: E402
from support.scratch import scratch_root  # noqa: E402


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description="Run campaigns of hostile inputs.")
    parser.add_argument("campaigns", nargs="*", metavar="CAMPAIGN", help=f"{', '.join(NAMES)} (default: all)")
    parser.add_argument("--seed", type=int, default=SEED, help=f"seed of the cases (default: {SEED})")
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--minutes", type=float, help="time for all campaigns together, in equal parts")
    length.add_argument("--count", type=int, help="number of cases of each campaign (default: as the tests run)")
    length.add_argument("--index", type=int, help="check only the case with this index")
    length.add_argument("--list", action="store_true", help="list the campaigns, and what each case proves")
    parser.add_argument("--processes", type=int, default=1, help="number of processes (default: 1)")
    parser.add_argument("--output", type=Path, default=Path("fuzz-failures"), help="folder for failing cases")
    return parser


def main() -> int:
    """Run the campaigns that the arguments name. Return 1 if one fails."""
    parser = _parser()
    options = parser.parse_args()
    os.environ["MSGGEN_DIRECT"] = "1"  # no case starts a process that owns a link
    os.environ["XDG_STATE_HOME"] = state = tempfile.mkdtemp(prefix="state-")
    atexit.register(shutil.rmtree, state, ignore_errors=True)
    unknown = [name for name in options.campaigns if name not in NAMES]
    if unknown:
        parser.error(f"unknown campaign '{unknown[0]}' (choose from {', '.join(NAMES)})")
    names = options.campaigns or NAMES
    if options.list:
        print(*map(_description, names), sep="\n")
        return 0
    seconds = options.minutes * 60 / len(names) if options.minutes else None
    failed = False
    warnings.simplefilter("ignore")  # numpy warns about some of the hostile values
    tempfile.tempdir = scratch = scratch_root()
    atexit.register(shutil.rmtree, scratch, ignore_errors=True)
    for name in names:
        if options.index is not None:
            parts: list[Iterable[int]] = [[options.index]]
        else:
            count = None if seconds else options.count or find(name).COUNT
            parts = [indices_of(process, options.processes, count) for process in range(options.processes)]
        failed |= not _campaign(name, options.seed, parts, seconds, options.output)
    return int(failed)


def _description(name: str) -> str:
    campaign = find(name)
    return f"{name}: {campaign.COUNT:,} cases at night\n{indent(str(campaign.__doc__).strip(), '    ')}\n"


def _campaign(name: str, seed: int, parts: Sequence[Iterable[int]], seconds: float | None, output: Path) -> bool:
    """Run one campaign, with a process for each of `parts`, and print its count. Return whether no case failed."""
    start = time.monotonic()
    work = partial(run, name, seed, seconds=seconds)
    if len(parts) == 1:
        results = [work(parts[0])]
    else:
        with ProcessPoolExecutor(len(parts), multiprocessing.get_context("fork")) as pool:
            results = list(pool.map(work, parts))
    count = sum(each for each, _ in results)
    failures = [failure for _, failure in results if failure]
    state = "failed" if failures else "ok"
    print(f"{name:12} {count:>10,} cases {time.monotonic() - start:>8.1f} s  seed {seed}  {state}", flush=True)
    for failure in failures:
        _report(failure, output)
    return not failures


def _report(failure: Failure, output: Path) -> None:
    print(f"\n{failure.trace}\ncase saved to {failure.save(output)}\nrepeat with: {failure.command}\n", flush=True)


if __name__ == "__main__":
    sys.exit(main())
