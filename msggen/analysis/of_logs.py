"""What recordings say of a flight, as arrays: the functions that users import from `msggen.analysis`.

`start` and `stop` are times in s after the start of the recording. Of several vehicles in a recording, it is the one
with the most topics. All functions raise RecordingError if the recording cannot be read, and those that return one
thing if the recording does not tell it.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from msggen.analysis import outputs, response, sampling
from msggen.analysis.finding import Unsaid
from msggen.analysis.motion import SENSORS, Sensor, motion_of
from msggen.analysis.motion import TOPICS as MOTION
from msggen.analysis.outputs import Innovation, Outputs, Thrust
from msggen.analysis.recorded import Recorded
from msggen.analysis.response import Response
from msggen.analysis.sampling import flown
from msggen.analysis.spectrum import Spectrogram, Spectrum, Windows, spectrogram_of, spectrum_of, windows_of
from msggen.base.diagnostics import suggestion
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log

_Said = TypeVar("_Said")
_SOURCE = re.compile(r"(?P<name>\w+)(?:\[(?P<instance>\d{1,3})\])?")


@np.errstate(all="ignore")
def step_responses(log: Log, *, start: float | None = None, stop: float | None = None) -> list[Response]:
    """Return how roll, pitch, yaw and their rates follow a step of their setpoint: six responses.

    Each has `times` in s, `mean` and `spread` in parts of the step, and `delay`, `rise`, `overshoot` and `settling`;
    or a `verdict` that tells why not, such as too little excitation.
    """
    recorded = _recorded(log, response.TOPICS)
    return response.responses_of(recorded, start, stop)


@np.errstate(all="ignore")
def sensor_spectrum(
    log: Log, source: str = "gyro", sensor: str = "", *, start: float | None = None, stop: float | None = None
) -> Spectrum:
    """Return how strongly a sensor moves at each frequency in flight.

    `source` is `gyro` or `accel`, for the topic with the most samples per second, or a topic: `sensor_gyro_fifo[1]`.
    `sensor` is needed for a topic of both: `accel` for the accelerometer of `sensor_combined`.
    `density` is in the square of deg/s or m/s² per Hz, with an array for each axis; `amplitude` is in deg/s or m/s².
    """
    recorded = _recorded(log, MOTION)
    return spectrum_of(recorded, _windows(recorded, source, sensor, (start, stop)))


@np.errstate(all="ignore")
def sensor_spectrogram(
    log: Log, source: str = "gyro", sensor: str = "", *, start: float | None = None, stop: float | None = None
) -> Spectrogram:
    """Return how strongly a sensor moves over time: the sum of its axes. The arguments are as in `sensor_spectrum`."""
    recorded = _recorded(log, MOTION)
    return spectrogram_of(recorded, _windows(recorded, source, sensor, (start, stop)), start or 0.0, stop)


@np.errstate(all="ignore")
def actuator_outputs(log: Log, *, start: float | None = None, stop: float | None = None) -> list[Outputs]:
    """Return the outputs of motors and servos over time, each topic with a histogram of the time in flight.

    Without actuator_motors and actuator_servos, they are those of actuator_outputs. None that is never used is there.
    """
    recorded = _recorded(log, outputs.TOPICS)
    return outputs.outputs_of(recorded, start, stop)


@np.errstate(all="ignore")
def hover_thrust(log: Log, *, start: float | None = None, stop: float | None = None) -> Thrust:
    """Return the thrust upwards, from 0 to 1, against that at which the vehicle hovers."""
    recorded = _recorded(log, outputs.TOPICS)
    return said(outputs.thrust_of(recorded, start, stop))


@np.errstate(all="ignore")
def innovations(log: Log) -> list[Innovation]:
    """Return what sources of the estimator measured minus what was expected, with their gates."""
    recorded = Recorded(log, outputs.is_needed)
    return outputs.innovations_of(recorded)


def sources(name: str) -> list[tuple[Sensor, str, int]]:
    """Return the sensors that a name such as `gyro` or `sensor_gyro[1]` stands for, with topic and instance.

    Raises RecordingError for any other name.
    """
    found = _SOURCE.fullmatch(name)
    word, instance = (found["name"], int(found["instance"] or 0)) if found else (name, 0)
    chosen = [(sensor, "", instance) for sensor in SENSORS if word == sensor.name]
    chosen += [(sensor, word, instance) for sensor in SENSORS if word in sensor.names]
    if not chosen:
        known = [*(sensor.name for sensor in SENSORS), *(topic for sensor in SENSORS for topic in sensor.names)]
        raise RecordingError(f"no topic of a gyroscope or an accelerometer is called '{name}'{suggestion(word, known)}")
    return chosen


def said(found: _Said | Unsaid) -> _Said:
    """Return what the recording tells. Raises RecordingError with the reason if it does not."""
    if isinstance(found, Unsaid):
        raise RecordingError(found.reason)
    return found


def _recorded(log: Log, topics: Collection[str]) -> Recorded:
    return Recorded(log, lambda name: name in topics or name in sampling.TOPICS)


def _windows(recorded: Recorded, source: str, name: str, times: tuple[float | None, float | None]) -> Windows:
    chosen = sources(source)
    sensor, topic, instance = next((each for each in chosen if each[0].name == name), chosen[0])
    return said(windows_of(said(motion_of(recorded, sensor, topic, instance, spans=flown(recorded, *times)))))
