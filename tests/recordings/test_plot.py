"""Tests of pictures of recordings: the objects of their figures, and their files."""

from __future__ import annotations

import itertools
import math
import re
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen import recordings
from msggen.recordings.columns.annotations import Annotation
from msggen.recordings.log import plot, series
from support.examples import examples
from support.ulog import UlogWriter
from support.written import write_recording

NAN = math.nan
MODES = [(0.0, 4), (2.0, 14), (6.0, 18)]
"""Times in s, and values of nav_state."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory, px4_types: Any) -> Iterator[recordings.Log]:
    samples = sorted(_samples(px4_types), key=lambda each: each[1])
    path = write_recording(tmp_path_factory.mktemp("plot") / "flight.mcap", samples)
    with recordings.open(path) as found:
        yield found


def _samples(types: Any) -> Iterator[tuple[str, float, Any]]:
    for time, mode in MODES:
        armed = types.VehicleStatus.ARMING_STATE_ARMED if mode == 14 else types.VehicleStatus.ARMING_STATE_DISARMED
        yield "/fmu/out/vehicle_status_v4", time, types.VehicleStatus(nav_state=mode, arming_state=armed)
    for step in range(101):
        time = step / 10
        z = NAN if 40 <= step < 50 else float(-step)
        local = types.VehicleLocalPosition(x=float(step), z=z, vx=2.0, z_valid=step >= 50)
        yield "/fmu/out/vehicle_local_position_v1", time, local
        yield "/fmu/out/vehicle_attitude", time, types.VehicleAttitude(q=[1.0, 0.0, 0.0, float(step)])
        yield "/fmu/out/actuator_motors", time, types.ActuatorMotors(control=[step / 100] * 12)
        yield "/fmu/out/sensor_gps", time, types.SensorGps(eph=1.0)
        yield "/fmu/out/sensor_gps_1", time, types.SensorGps(eph=2.0)
        flags = 1 if step < 20 else 5
        yield "/fmu/out/esc_status", time, types.EscStatus(esc_online_flags=flags, esc_connectiontype=5)


def lines(axes: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in axes.get_lines()}


def bands(axes: Any) -> dict[str, list[tuple[float, float]]]:
    """The begin and the end of the bands of a panel, by their names on the axis."""
    names = [label.get_text() for label in axes.get_yticklabels()]
    spans = [
        sorted((path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in each.get_paths())
        for each in axes.collections
    ]
    return {name: [tuple(np.round(span, 6)) for span in each] for name, each in zip(names, spans, strict=True)}


def test_fields_of_a_unit_share_a_panel(log: recordings.Log) -> None:
    paths = [f"vehicle_local_position.{name}" for name in ("x", "vx", "z")]
    figure = plot.draw(log, paths)
    first, second = figure.axes
    assert (first.get_ylabel(), second.get_ylabel()) == ("[m]", "[m/s]")
    assert list(lines(first)) == [paths[0], paths[2]]
    assert list(lines(second)) == [paths[1]]
    assert second.get_xlabel() == "time since the start [s]"
    assert first.get_xlim() == second.get_xlim() == (0.0, 10.0)
    np.testing.assert_allclose(lines(first)[paths[0]].get_xdata(), np.arange(101) / 10)
    np.testing.assert_array_equal(lines(first)[paths[0]].get_ydata(), np.arange(101))


def test_values_that_are_missing_are_not_joined(log: recordings.Log) -> None:
    (axes,) = plot.draw(log, ["vehicle_local_position.z"]).axes
    values = lines(axes)["vehicle_local_position.z"].get_ydata()
    assert np.isnan(values).nonzero()[0].tolist() == list(range(40, 50))


def test_values_with_names_are_bands(log: recordings.Log) -> None:
    status, armed, valid = plot.draw(
        log, ["vehicle_status.nav_state", "vehicle_status.arming_state", "vehicle_local_position.z_valid"]
    ).axes
    assert bands(status) == {"AUTO_LOITER": [(0, 2)], "OFFBOARD": [(2, 6)], "AUTO_LAND": [(6, 9)]}
    assert bands(armed) == {"DISARMED": [(0, 2), (6, 9)], "ARMED": [(2, 6)]}
    assert bands(valid) == {"false": [(0, 5)], "true": [(5, 10.1)]}
    assert [text.get_text() for text in armed.texts] == ["vehicle_status.arming_state"]


def test_the_flight_modes_are_the_background_of_all_panels(log: recordings.Log) -> None:
    figure = plot.draw(log, ["vehicle_local_position.x", "vehicle_local_position.vx"])
    for axes in figure.axes:
        patches: list[Any] = list(axes.patches)
        found = {patch.get_label(): (patch.get_x(), patch.get_x() + patch.get_width()) for patch in patches}
        assert found == {"_Hold": (0, 2), "_Offboard": (2, 6), "_Land": (6, 9)}
        assert len({patch.get_facecolor() for patch in patches}) == 3
    assert [text.get_text() for text in figure.axes[0].texts] == ["Hold", "Offboard", "Land"]
    assert not figure.axes[1].texts


def test_fields_that_no_line_can_show_are_seen(tmp_path: Path, px4_types: Any) -> None:
    gps = px4_types.SensorGps(eph=NAN, epv=1.5)
    with recordings.open(write_recording(tmp_path / "one.mcap", [("/fmu/out/sensor_gps", 0.0, gps)])) as log:
        (axes,) = plot.draw(log, ["sensor_gps.eph", "sensor_gps.epv"]).axes
        found = {label: line.get_marker() for label, line in lines(axes).items()}
        assert found == {"sensor_gps.eph (never a finite number)": "", "sensor_gps.epv": "."}


def test_numbers_between_others_that_are_not_are_seen(tmp_path: Path, px4_types: Any) -> None:
    values = [NAN, 1.0, NAN, 2.0, 3.0, NAN, 4.0]
    samples = [("/fmu/out/sensor_gps", float(time), px4_types.SensorGps(eph=eph)) for time, eph in enumerate(values)]
    with recordings.open(write_recording(tmp_path / "gaps.mcap", samples)) as log:
        (axes,) = plot.draw(log, ["sensor_gps.eph"]).axes
        (line,) = axes.get_lines()
        assert (line.get_marker(), line.get_markevery()) == (".", [1, 6])


def test_the_legend_has_place_for_its_notes(tmp_path: Path, px4_types: Any) -> None:
    setpoint = px4_types.VehicleAttitudeSetpoint(q_d=[NAN] * 4)
    topic = "/fmu/out/vehicle_attitude_setpoint"
    with recordings.open(write_recording(tmp_path / "nan.mcap", [(topic, 0.0, setpoint)])) as log:
        figure = plot.draw(log, ["vehicle_attitude_setpoint.q_d"])
        figure.canvas.draw()
        legend = figure.axes[0].get_legend()
        assert legend is not None
        assert legend.get_window_extent().x0 >= figure.axes[0].bbox.x0


def test_arrays_instances_and_elements_are_paths(log: recordings.Log) -> None:
    found = plot.read_series(
        log, ["vehicle_attitude.q", "actuator_motors.control[3]", "sensor_gps.eph", "sensor_gps[1].eph"]
    )
    assert [each.label for each in found] == [
        *(f"vehicle_attitude.q[{index}]" for index in range(4)),
        "actuator_motors.control[3]",
        "sensor_gps.eph",
        "sensor_gps_1.eph",  # in ROS 2 an instance is a topic of its own
    ]
    assert [each.values[-1] for each in found] == [1.0, 0.0, 0.0, 100.0, 1.0, 1.0, 2.0]
    assert len(plot.draw(log, ["vehicle_attitude.q", "actuator_motors.control[3]", "sensor_gps.eph"]).axes) == 3


def test_a_stretch_of_time(log: recordings.Log) -> None:
    (axes,) = plot.draw(log, ["vehicle_local_position.x"], start=3.0, stop=5.0).axes
    np.testing.assert_allclose(lines(axes)["vehicle_local_position.x"].get_xdata(), np.arange(30, 50) / 10)
    assert axes.get_xlim() == (3.0, 5.0)


def test_a_picture_ends_with_its_fields(tmp_path: Path, px4_types: Any) -> None:
    samples = [("/fmu/out/vehicle_status_v4", step / 2, px4_types.VehicleStatus(nav_state=4)) for step in range(13)]
    samples += [("/fmu/out/vehicle_attitude", step / 2, px4_types.VehicleAttitude()) for step in range(13)]
    samples.append(("/fmu/out/sensor_gps", 1000.0, px4_types.SensorGps()))
    with recordings.open(write_recording(tmp_path / "late.mcap", samples)) as log:
        (status,) = plot.draw(log, ["vehicle_status.nav_state"]).axes
        assert bands(status) == {"AUTO_LOITER": [(0, 6.5)]}
        assert status.get_xlim() == (0, 6.5)
        (attitude,) = plot.draw(log, ["vehicle_attitude.q[0]"], stop=900.0).axes
        assert attitude.get_xlim() == (0, 6)
        (gps,) = plot.draw(log, ["sensor_gps.eph", "vehicle_attitude.q[0]"]).axes[:1]
        mode: Any = gps.patches[0]
        assert gps.get_xlim() == (0, 1000)
        assert mode.get_x() + mode.get_width() == 6.5
        # a value lasts until the next sample, if there is one behind the time that was asked for
        (status,) = plot.draw(log, ["vehicle_status.nav_state"], stop=3.4).axes
        assert bands(status) == {"AUTO_LOITER": [(0, 3.4)]}


BEGIN = 1_700_000_000_000_000
"""The start in us of a log that counts since 1970: a topic that was published once before has the time 0."""


@pytest.fixture
def older(tmp_path: Path) -> Iterator[recordings.Log]:
    """A log with samples before its start: of `wind` and `actuator_armed` also later ones, of `airspeed` none."""
    writer = UlogWriter(start=BEGIN)
    topics = {
        "wind": "float x",
        "actuator_armed": "bool armed;uint8_t count",
        "airspeed": "float x",
        "vehicle_status": "uint8_t nav_state",
    }
    for number, (name, fields) in enumerate(topics.items()):
        writer.format(name, f"uint64_t timestamp;{fields}")
        writer.subscribe(number, name)
    writer.sample(1, struct.pack("<QBB", 0, 1, 8))
    for time in (0, BEGIN - 46_000_000, BEGIN + 1_000_000, BEGIN + 2_000_000):
        writer.sample(0, struct.pack("<Qf", time, 1.0 + (time > BEGIN)))
    for time, is_armed in ((BEGIN - 46_000_000, False), (BEGIN + 1_000_000, True)):
        writer.sample(1, struct.pack("<Q?B", time, is_armed, 7 + is_armed))
    writer.sample(2, struct.pack("<Qf", BEGIN - 5_000_000, 3.0))
    for time, mode in ((BEGIN - 46_000_000, 4), (BEGIN + 1_000_000, 5)):
        writer.sample(3, struct.pack("<QB", time, mode))
    with recordings.open(writer.write(tmp_path / "older.ulg")) as log:
        yield log


@pytest.mark.parametrize("start", [None, 0])
def test_a_picture_begins_at_the_start_of_the_recording(older: recordings.Log, start: float | None) -> None:
    wind, armed, count = plot.draw(older, ["wind.x", "actuator_armed.armed", "actuator_armed.count"], start=start).axes
    assert wind.get_xlim() == (0, 2)
    (line,) = wind.get_lines()
    assert line.get_xydata().tolist() == [[1, 2], [2, 2]]  # type: ignore[union-attr]
    (line,) = count.get_lines()
    assert line.get_xydata().tolist() == [[0, 7], [1, 8]]  # type: ignore[union-attr]
    assert bands(armed)["false"] == [(0, 1)]
    assert bands(armed)["true"][0][0] == 1


def test_flight_modes_before_the_start_and_without_names(older: recordings.Log) -> None:
    (axes,) = plot.draw(older, ["wind.x"]).axes
    patches: list[Any] = list(axes.patches)
    assert [(patch.get_label(), patch.get_x()) for patch in patches] == [("_nav_state 4", 0), ("_nav_state 5", 1)]
    assert [name.get_text() for name in axes.texts] == ["nav_state 4", "nav_state 5"]
    assert len({patch.get_facecolor() for patch in patches}) == 2


def test_a_picture_of_older_samples_begins_with_them(older: recordings.Log) -> None:
    (alone,) = plot.draw(older, ["airspeed.x"]).axes
    assert alone.get_xlim() == (-5, -4)
    assert alone.get_lines()[0].get_xydata().tolist() == [[-5, 3]]  # type: ignore[union-attr]
    airspeed, _ = plot.draw(older, ["airspeed.x", "wind.x"]).axes
    assert airspeed.get_xlim() == (0, 2)
    assert airspeed.get_lines()[0].get_xydata().tolist() == [[0, 3]]  # type: ignore[union-attr]


def test_an_exponent_covers_no_flight_mode(log: recordings.Log) -> None:
    times = np.arange(100) / 10
    series = plot.Series("a.b", times, 1e15 + times * 1e9, Annotation("us"), 10.0)
    figure = plot.draw_series(log, [series])
    plot.render(figure, "png")
    (axes,) = figure.axes
    exponent = axes.yaxis.get_offset_text()
    assert exponent.get_text()
    for name in axes.texts:
        assert not name.get_window_extent().overlaps(exponent.get_window_extent())


@settings(max_examples=examples(100, by_day=12))
@given(
    kind=st.sampled_from([f"{sign}{size}" for sign in "iu" for size in (1, 2, 4, 8)]),
    named=st.sets(st.integers(0, 63)),
    data=st.data(),
)
def test_each_bit_that_occurs_has_a_band(kind: str, named: set[int], data: st.DataObject) -> None:
    width = 8 * np.dtype(kind).itemsize
    bits = data.draw(st.lists(st.sets(st.integers(0, width - 1)), min_size=1, max_size=5))
    values = np.array([sum(1 << bit for bit in each) for each in bits], f"u{width // 8}").view(kind)
    about = Annotation(members={1 << bit: f"NAME_{bit}" for bit in named}, is_flags=True)
    series = plot.Series("x", np.arange(len(values), dtype=float), values, about, float(len(values)))
    occurring = sorted(set().union(*bits))
    names = [f"NAME_{bit}" if bit in named else f"bit {bit}" for bit in occurring]
    assert [band.name for band in series.bands] == names + ["none"] * (set() in bits)
    for bit, band in zip(occurring, series.bands, strict=False):
        held = sum(end - begin for begin, end in band.spans)
        assert held == sum(bit in each for each in bits)


@pytest.mark.parametrize(
    ("path", "text"),
    [
        (
            "vehicle_local_positon.x",
            "no topic is called 'vehicle_local_positon', did you mean 'vehicle_local_position'?",
        ),
        ("vehicle_local_position.heding", "no field is called 'heding', did you mean 'heading'?"),
        ("vehicle_attitude.q[4]", "no field is called 'q[4]', did you mean 'q["),
        ("sensor_gps[7].eph", "'sensor_gps' has no instance 7, it has: 0"),
        ("vehicle_attitude", "'vehicle_attitude' is a topic: name one of its fields, such as q[0], "),
        ("vehicle_atitude", "expected TOPIC.FIELD or TOPIC[INSTANCE].FIELD, found 'vehicle_atitude', did you mean 'v"),
        (
            "vehicle_attitude/q",
            "expected TOPIC.FIELD or TOPIC[INSTANCE].FIELD, found 'vehicle_attitude/q', did you mean 'vehicle_att",
        ),
        ("sensor_gps[x].eph", "expected TOPIC.FIELD or TOPIC[INSTANCE].FIELD, found 'sensor_gps[x].eph'"),
    ],
)
def test_paths_that_there_are_not(log: recordings.Log, path: str, text: str) -> None:
    with pytest.raises(recordings.RecordingError, match=f"^{re.escape(text)}"):
        plot.draw(log, [path])


def test_a_time_without_samples(log: recordings.Log) -> None:
    paths = ["vehicle_status.nav_state", "vehicle_local_position.x", "vehicle_status.arming_state"]
    with pytest.raises(
        plot.NoSamplesError, match=r"^there are no samples of /fmu/out/vehicle_status_v4 in this time$"
    ) as told:
        plot.draw(log, paths, start=7.0, stop=8.0)
    assert told.value.paths == [paths[0], paths[2]]


@pytest.mark.parametrize("count", [1, 3, 7])
def test_the_legend_covers_no_line(count: int, log: recordings.Log) -> None:
    names = ("x", "y", "z", "z_deriv", "delta_z", "dist_bottom", "delta_dist_bottom")
    times, values = np.arange(100) / 10, np.arange(100.0) % 10
    series = [
        plot.Series(f"vehicle_local_position.{name}", times, values, Annotation("m"), 10.0) for name in names[:count]
    ]
    figure = plot.draw_series(log, series)
    figure.canvas.draw()
    (axes,) = figure.axes
    legend = axes.get_legend()
    assert legend is not None
    box = legend.get_window_extent()
    assert axes.bbox.x0 <= box.x0 <= box.x1 <= axes.bbox.x1
    for line in axes.lines:
        assert axes.transData.transform(line.get_xydata())[:, 1].max() < box.y0


def test_files(log: recordings.Log) -> None:
    def picture(ending: str) -> bytes:
        paths = ["vehicle_local_position.x", "vehicle_status.nav_state"]
        return plot.render(plot.draw(log, paths), ending)

    png, svg, pdf = map(picture, plot.ENDINGS)
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    assert pdf.startswith(b"%PDF")
    width, height = struct.unpack(">II", png[16:24])
    assert width == 1000
    assert 300 < height < 600
    assert len(png) > 10_000
    text = svg.decode()
    for shown in ("flight.mcap", "vehicle_local_position.x", "[m]", "OFFBOARD", "time since the start [s]"):
        assert f">{shown}<" in text
    assert svg == picture("svg")


def test_a_picture_is_drawn_without_a_window(log: recordings.Log) -> None:
    plot.render(plot.draw(log, ["vehicle_local_position.x"]), "png")
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()


# Thinning


def joined(values: Any) -> set[tuple[int, int]]:
    """The pairs of samples that a line joins, by their numbers."""
    return {(low, low + 1) for low in range(len(values) - 1) if np.isfinite(values[low : low + 2]).all()}


@settings(max_examples=examples(20))
@given(seed=st.integers(0, 2**32 - 1), share=st.sampled_from([0.0, 0.01, 0.5, 0.99, 1.0]))
def test_thinned_lines_have_every_peak_and_every_gap(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    count = 20_000
    times = np.sort(random.uniform(0, 100, count))
    values = random.normal(size=count)
    values[random.uniform(size=count) < share] = NAN
    kept = plot.thinned(times, values)
    assert (np.diff(kept) > 0).all()
    assert len(kept) <= 5 * series.PIXELS
    pixels = ((times - times[0]) * ((series.PIXELS - 1) / (times[-1] - times[0]))).astype(int)
    for pixel in np.unique(pixels)[:: 1 + seed % 100]:
        whole, part = values[pixels == pixel], values[kept][pixels[kept] == pixel]
        if np.isfinite(whole).any():
            assert (np.nanmin(whole), np.nanmax(whole)) == (np.nanmin(part), np.nanmax(part))
        else:
            assert np.isnan(part).all()
        assert np.isnan(whole).any() == np.isnan(part).any()
    # between pixels, the line joins the same neighbours, or none
    for low, high in itertools.pairwise(kept.tolist()):
        if pixels[low] != pixels[high]:
            assert high == low + 1


def test_few_samples_are_all_drawn() -> None:
    assert plot.thinned(np.arange(100.0), np.arange(100.0)).tolist() == list(range(100))


def test_bands_closer_than_a_pixel_are_one() -> None:
    times = np.arange(100_000) / 1000
    values = np.arange(100_000) % 2 == 0
    values[50_000:60_000] = False
    false, true = plot.Series("x", times, values, Annotation(), 100.0).bands
    assert [np.round(span, 2).tolist() for span in true.spans] == [[0, 50], [60, 100]]
    assert [np.round(span, 2).tolist() for span in false.spans] == [[0, 100]]


HOSTILE = (
    "$\\frac{$",
    "$x$",
    "_hidden",
    "a\nb\x1b[31m\x00",
    "\\input{/etc/hosts}",
    "</text><script>",
    "\udcff",
    "x" * 10_000,
)
"""Names and units of strangers."""
JOINED = [("".join(HOSTILE[:4]), 4), ("".join(HOSTILE[4:7]), 40)]
"""The short ones, several in one, with few or with many changes of the mode. At night, each is alone with both."""


def drawn(name: str, log: recordings.Log, monkeypatch: pytest.MonkeyPatch, changes: int) -> Any:
    """Draw a picture with a name in every place."""
    times, about = np.arange(40) / 4, Annotation(name, "", {number: f"{name}{number}" for number in range(3)})
    plain = about._replace(members={})
    modes = plot.Series(name, times, np.arange(40) // (40 // changes) % 3, about, 10.0)
    monkeypatch.setattr(plot, "read_modes", lambda *_, **__: modes)
    monkeypatch.setattr(type(log), "path", f"folder/{name}.mcap")
    lines = [plot.Series(f"{name}{end}", times, np.arange(40) * 1e9, plain, 10.0) for end in "ab"]
    lines.append(plot.Series(name, times, np.full(40, NAN), plain._replace(unit=""), 10.0))
    return plot.draw_series(log, [*lines, plot.Series(name, times, np.arange(40) % 3, about, 10.0)])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("name", "changes"),
    [*JOINED, *(pytest.param(name, changes, marks=pytest.mark.night) for name in HOSTILE for changes in (4, 40))],
)
def test_names_of_strangers_are_drawn_as_they_are(
    name: str, changes: int, log: recordings.Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib import rc_context
    from matplotlib.text import Text

    with rc_context({"text.parse_math": True, "axes.formatter.use_mathtext": True, "axes.formatter.limits": [-2, 2]}):
        figure = drawn(name, log, monkeypatch, changes)
        texts = [text for text in figure.findobj(Text) if text.get_text()]
        assert not any(text.get_parse_math() or text.get_usetex() for text in texts)
        found = "".join(ET.fromstring(plot.render(figure, "svg")).itertext())  # noqa: S314 - our own
        assert plot.render(figure, "png")
        assert plot.render(figure, "pdf")
    shown = series.shown(name)
    assert shown.isprintable()
    for text in (f"{shown}a", f"{shown} (never a finite number)", f"[{shown}]", f"{series.shown(name + '1')}"):
        if len(name) < 100:
            assert text in found
    assert found.count(shown[:18]) > 8
