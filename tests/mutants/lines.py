"""A plugin of pytest that tells which tests run which lines of some modules: MUTANTS_MODULES, MUTANTS_LINES."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

_MODULES = frozenset(json.loads(os.environ.get("MUTANTS_MODULES", "[]")))
_found: dict[str, dict[str, Any]] = {}
_failed: set[str] = set()
_lines: dict[str, set[int]] = defaultdict(set)


def _in_frame(frame: FrameType, event: str, _value: object) -> Any:
    if frame.f_code.co_filename not in _MODULES:
        return None
    if event == "line":
        _lines[frame.f_code.co_filename].add(frame.f_lineno)
    return _in_frame


def _write() -> None:
    """Write whole files only: this process is ended when its time is over."""
    path = Path(os.environ["MUTANTS_LINES"])
    path.with_suffix(".part").write_text(json.dumps(_found), encoding="utf-8")
    path.with_suffix(".part").replace(path)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Leave out a test that fails without any change."""
    if report.failed:
        _failed.add(report.nodeid)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, None, None]:
    """Watch a test, with its fixtures."""
    _lines.clear()
    started = time.perf_counter()
    threading.settrace(_in_frame)
    sys.settrace(_in_frame)
    yield
    sys.settrace(None)
    threading.settrace(None)
    seen = {path: sorted(lines) for path, lines in _lines.copy().items()}
    if item.nodeid not in _failed:
        _found[item.nodeid] = {"seconds": time.perf_counter() - started, "lines": seen}
        _write()
