"""Recordings of flights with values and times of any kind, for what analysis finds in them and for reports.

What is found is finite, or says why there is none.
"""

from __future__ import annotations

import importlib
import json
import math
import re
from collections.abc import Iterator
from random import Random
from typing import Any, NamedTuple

import numpy as np

from msggen import analysis, recordings
from msggen.exports.pictures import PICTURES, draw
from msggen.exports.report.page import report
from msggen.recordings import RecordingError
from support.moving import messages_of
from support.scratch import scratch_folder
from support.written import write_recording

COUNT = 120
_TYPES: Any = importlib.import_module("px4_types")
_ODD = (math.nan, math.inf, -math.inf, 1e30, -1e30, 1e-40, 0.0, 1e6)
_FIFO = ("sensor_gyro_fifo", "SensorGyroFifo"), ("sensor_accel_fifo", "SensorAccelFifo")


class Case(NamedTuple):
    """What is done to a flight."""

    seconds: float
    """How much of it there is."""
    odd: float
    """The share of odd values."""
    gap: tuple[float, float]
    jump: float
    """By how many s the times change in the middle."""
    clock: str
    """What timestamps in the samples are."""
    fifo: bool
    seed: int


def case(chance: Random) -> Case:
    """Return a random case."""
    return Case(
        chance.choice((0.0, 0.2, 2.0, 8.0, 8.0, 8.0)),
        chance.choice((0.0, 0.0, 0.01, 0.5, 1.0)),
        (chance.uniform(0, 8), chance.choice((0.0, 0.1, 3.0))),
        chance.choice((0.0, 0.0, 0.0, 1e-9, 100.0, 1e8)),
        chance.choice(("right", "right", "zero", "same", "any", "back")),
        chance.random() < 0.5,
        chance.randrange(1 << 30),
    )


def _samples(case: Case) -> Iterator[tuple[str, float, Any]]:
    """Yield the samples, with what the case does to them."""
    chance = Random(case.seed)  # noqa: S311 - no secret
    begin, length = case.gap
    for name, time, message in messages_of(_TYPES):
        if time > case.seconds:
            break
        if begin <= time < begin + length:
            continue
        values = {field.name: getattr(message, field.name) for field in message.__msg__.fields}
        for field, value in values.items():
            if chance.random() < case.odd and isinstance(value, (float, tuple)):
                odd = chance.choice(_ODD)
                values[field] = odd if isinstance(value, float) else tuple(odd for _ in value)
        values["timestamp"] = _stamp(case.clock, values["timestamp"], chance)
        yield f"/fmu/out/{name}", _time(case, time), type(message)(**values)
    for step in range(round(case.seconds * 100) if case.fifo else 0):
        for name, kind in _FIFO:
            hostile = chance.random() < case.odd
            values = {
                "timestamp": _stamp(case.clock, step * 10_000 + 1, chance),
                "dt": chance.choice(_ODD) if hostile else 1250.0,
                "scale": chance.choice(_ODD) if hostile else 0.01,
                "samples": chance.randrange(256) if hostile else 8,
                **{axis: tuple(chance.randrange(-32768, 32768) for _ in range(32)) for axis in "xyz"},
            }
            yield f"/fmu/out/{name}", _time(case, step / 100), getattr(_TYPES, kind)(**values)


def _time(case: Case, time: float) -> float:
    return time + (case.jump if time > case.seconds / 2 else 0.0)


def _stamp(clock: str, stamp: int, chance: Random) -> int:
    found = {"zero": 0, "same": 7, "any": chance.randrange(1 << 64), "back": max(10**7 - stamp, 0)}
    return found.get(clock, stamp)


def check(case: Case) -> None:
    """Analyse the flight, and make a report and a picture of it."""
    with scratch_folder() as folder:
        samples = sorted(_samples(case), key=lambda sample: sample[1])
        with recordings.open(str(write_recording(folder / "flight.mcap", samples))) as log:
            _check_responses(log)
            for source in ("gyro", "accel"):
                _check_spectra(log, source)
            for outputs in analysis.actuator_outputs(log):
                assert np.isfinite(outputs.shares).all()
                assert (outputs.shares.sum(axis=1) <= 1 + 1e-9).all()
            for each in analysis.innovations(log):
                assert len(each.times) == len(each.values) == len(each.gate)
                assert each.text
            kind = list(PICTURES)[case.seed % 40 % len(PICTURES)] if case.seed % 40 < len(PICTURES) else ""
            if kind:
                draw(log, kind)
            _check_report(log)


def _check_responses(log: Any) -> None:
    for each in analysis.step_responses(log):
        assert bool(each.verdict) != bool(len(each.mean))
        assert np.isfinite(each.mean).all()
        assert np.isfinite(each.spread).all()
        assert "\n" not in each.text


def _check_spectra(log: Any, source: str) -> None:
    try:
        spectrum, gram = analysis.sensor_spectrum(log, source), analysis.sensor_spectrogram(log, source)
    except RecordingError:
        return
    assert np.isfinite(spectrum.density).all()
    assert (spectrum.density >= 0).all()
    assert not np.isinf(gram.density).any()
    assert (np.diff(gram.edges) > 0).all()


def _check_report(log: Any) -> None:
    try:
        page = report(log)
    except RecordingError:
        return
    (text,) = re.findall(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.DOTALL)
    json.loads(text)
    assert len(page) < 2_000_000
