"""Tests of step responses, spectra and histograms in the page of a report."""

from __future__ import annotations

import json
import re
from base64 import b64decode
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen import recordings
from msggen.exports.report.analysed import png
from msggen.exports.report.page import report
from support.lazy import Lazy
from support.moving import DELAY, SECONDS, TONE, write_moving
from support.written import write_recording

image = Lazy("matplotlib.image")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> str:
    with recordings.open(str(write_moving(tmp_path_factory.mktemp("moving") / "flight.mcap", px4_types))) as log:
        return report(log)


def charts_of(page: str) -> list[Any]:
    """Return the charts with axes of their own, in the order of the page."""
    (text,) = re.findall(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.DOTALL)
    return [chart for chart in json.loads(text)["charts"] if chart["axis"]]


def floats(text: str) -> np.ndarray[Any, Any]:
    return np.frombuffer(b64decode(text), "<f4")


def test_charts_have_axes_of_their_own(page: str) -> None:
    angles, rates, gyro, accel, outputs = charts_of(page)
    assert [line["label"] for line in angles["lines"]] == ["roll"]
    ((places, (values,)),) = rates["tables"]
    step = floats(values)[: np.argmax(floats(values))]
    assert np.interp(0.5, step, floats(places)[: len(step)]) == pytest.approx(DELAY, abs=0.015)
    for chart, axis in ((gyro, 0), (accel, 1)):
        ((places, density),) = chart["tables"]
        assert chart["axis"]["unit"] == "Hz"
        assert floats(places)[np.argmax(floats(density[axis]))] == pytest.approx(TONE, rel=0.05)
    assert (outputs["axis"]["low"], outputs["axis"]["high"]) == (0, 1)
    for _, values in outputs["tables"]:
        assert [float(floats(each).sum()) for each in values] == pytest.approx([100] * 4)


def test_what_cannot_be_said_is_told_below_the_charts(page: str, tmp_path: Path, px4_types: Any) -> None:
    assert re.search(r'<p class="note">yaw rate: too little excitation: the setpoint changed by up to 0.0 deg/s', page)
    assert "neither an estimate of the hover thrust nor MPC_THR_HOVER is known" in page
    status = [("/fmu/out/vehicle_local_position", step / 10, px4_types.VehicleLocalPosition()) for step in range(20)]
    with recordings.open(str(write_recording(tmp_path / "bare.mcap", status))) as log:
        bare = report(log)
    assert "Responses and spectra" not in bare
    assert "step response of angles (the recording has no vehicle_attitude)" in bare
    assert "spectrum of the acceleration (the recording has no sensor_accel_fifo, sensor_accel, " in bare


def test_a_spectrogram_is_an_image_of_the_whole_recording(page: str) -> None:
    found = re.findall(r'<img src="data:image/png;base64,([^"]+)"', page)
    assert len(found) == 2
    pixels = image.imread(BytesIO(b64decode(found[0])), "png")
    rows, columns, _ = pixels.shape
    assert columns == pytest.approx(2 * SECONDS / 0.64, abs=2)  # windows of 64 samples that overlap by half
    bright = pixels[:, 5:-5, :3].sum(axis=2).argmax(axis=0)
    assert (1 - bright / rows) * 50 == pytest.approx([TONE] * len(bright), abs=3)


def test_an_image_has_the_colours_of_its_levels() -> None:
    levels = np.arange(49, dtype=np.uint8).reshape(7, 7)
    pixels = image.imread(BytesIO(png(levels)), "png")
    assert pixels.shape == (7, 7, 4)
    assert (pixels[..., 3] > 0).tolist() == (levels > 0).tolist()
    brightness = pixels[..., :3].sum(axis=2).ravel()[1:]
    assert (np.diff(brightness) > 0).all()
