"""Tests of pictures of what analysis finds, and of `msggen log plot` with their names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from msggen import recordings
from msggen.base.exit_codes import DONE, FAILED, FINDINGS
from msggen.cli import main
from msggen.exports.pictures import PICTURES, Span, draw
from support.moving import DELAY, SECONDS, TONE, write_moving
from support.written import write_recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS = {"step-response": 6, "spectrum": 2, "spectrogram": 2, "actuators": 1, "thrust": 1, "innovations": 1}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> Path:
    return write_moving(tmp_path_factory.mktemp("moving") / "flight.mcap", px4_types)


def drawn(path: Path, kind: str, words: Sequence[str] = (), span: Span | None = None) -> tuple[Figure, str]:
    with recordings.open(str(path)) as log:
        figure, texts, unsaid = draw(log, kind, words, span or Span())
    assert unsaid == []
    assert figure is not None
    return figure, "\n".join(texts)


@pytest.mark.parametrize("kind", PICTURES)
def test_each_picture_has_its_panels(kind: str, flight: Path) -> None:
    figure, _ = drawn(flight, kind)
    shown = [axes for axes in figure.axes if axes.get_visible() and axes.get_label() != "<colorbar>"]
    besides = kind in ("actuators", "thrust")
    assert len(shown) == _PANELS[kind] * (1 + besides)
    over_time = [axes for axes in shown if axes.get_xlabel() == "time since the start [s]"]
    assert bool(over_time) == (kind not in ("step-response", "spectrum"))
    assert all(axes.get_xlim() == pytest.approx((0, SECONDS), abs=0.1) for axes in over_time)


def test_step_responses_show_the_delay_and_why_some_are_missing(flight: Path) -> None:
    figure, texts = drawn(flight, "step-response")
    roll, pitch, *_ = figure.axes
    line = roll.lines[0]
    times, values = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
    assert np.interp(0.5, values[: np.argmax(values)], times[: np.argmax(values)]) == pytest.approx(DELAY, abs=0.015)
    assert pitch.texts[0].get_text().startswith("too little excitation:\nthe setpoint changed by up to 0.0 deg")
    assert "roll rate: delay 5" in texts
    assert "yaw: too little excitation: " in texts


@pytest.mark.parametrize(
    ("words", "expected"),
    [((), 2), (("gyro",), 1), (("sensor_combined",), 2), (("sensor_combined", "vehicle_angular_velocity"), 3)],
)
def test_words_choose_the_sensors_of_spectra(words: Sequence[str], expected: int, flight: Path) -> None:
    figure, texts = drawn(flight, "spectrum", words)
    assert len(figure.axes) == expected
    assert f"strongest tone of x {TONE:.0f} Hz (5.7 deg/s)" in texts
    assert figure.axes[0].get_xlim() == pytest.approx((0, 50), rel=0.01)


def test_a_part_of_the_recording_is_drawn(flight: Path) -> None:
    figure, _ = drawn(flight, "spectrogram", ["gyro"], Span(5, 10))
    assert figure.axes[0].get_xlim() == (5, 10)


def run(words: Sequence[str]) -> int:
    try:
        return main(["log", "plot", *words])
    except SystemExit as error:
        return int(error.code or 0)


@pytest.mark.parametrize("kind", ["step-response", "thrust"])
def test_the_command_writes_a_file_and_says_what_it_shows(
    kind: str, flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(tmp_path / "made.svg")
    assert run([str(flight), kind, "-o", path]) == DONE
    first, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{path}: ")
    assert rest
    assert run([str(flight), kind, "-o", path, "-q"]) == DONE
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("words", "code", "error"),
    [
        (["thrust", "gyro"], FAILED, "argument FIELD: thrust is a picture by itself: leave out gyro"),
        (["spectrum", "sensor_gyr"], FAILED, "no topic of a gyroscope or an accelerometer is called 'sensor_gyr', did"),
        (["spectrum", "sensor_gyro"], FINDINGS, "gyro: the recording has no sensor_gyro"),
        (["step-respons"], FAILED, "the name of a picture, found 'step-respons', did you mean 'step-response'?"),
    ],
)
def test_what_cannot_be_drawn_is_told(  # noqa: PLR0913, PLR0917
    words: Sequence[str], code: int, error: str, flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([str(flight), *words, "-o", str(tmp_path / "made.png")]) == code
    assert error in capsys.readouterr().err
    assert not (tmp_path / "made.png").exists()


@pytest.mark.parametrize("kind", PICTURES)
def test_a_recording_that_tells_nothing_says_why(
    kind: str, tmp_path: Path, px4_types: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    samples = [("/fmu/out/vehicle_status", step / 10, px4_types.VehicleStatus()) for step in range(2)]
    path = write_recording(tmp_path / "short.mcap", samples)
    assert run([str(path), kind, "-o", str(tmp_path / "made.png")]) == FINDINGS
    assert "the recording has no " in capsys.readouterr().err
    assert not (tmp_path / "made.png").exists()
