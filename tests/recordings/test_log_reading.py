"""Tests of reading a recording: what is left out, closed files, times, and samples that outlive their log."""

from __future__ import annotations

import copy
import gc
import pickle
import struct
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen import recordings
from msggen.base.missing import installing
from msggen.cli.commands.log.opening import problem_text
from msggen.recordings import Log, RecordingError, offset_between
from msggen.recordings.decode.left_out import LeftOut, leave_out
from support.catalogs import catalog_of, import_package
from support.databases import Stored, write_database
from support.log_files import FOO, START, TYPE, Written, foo, foos, opened, write_log
from support.ulog import COUNT, UlogWriter, write_ulog


@pytest.fixture
def ulog(tmp_path: Path) -> Iterator[Log]:
    write_ulog(tmp_path / "flight.ulg")
    with recordings.open(tmp_path / "flight.ulg") as log:
        yield log


def every_format(folder: Path) -> dict[str, Path]:
    """Return a recording in each format."""
    write_ulog(folder / "flight.ulg")
    stored = [(1, START + number, foo(number)) for number in range(9)]
    return {
        "ulog": folder / "flight.ulg",
        "mcap": write_log(folder / "flight.mcap", [foos("/a", range(3000))], chunk_size=4096),
        "db3": write_database(folder / "flight.db3", [Stored(1, "/a", TYPE, FOO)], stored),
    }


# what is left out


def test_a_sample_that_is_read_again_is_counted_once(tmp_path: Path) -> None:
    samples = [(START + number * 10**9, START, foo(number)[: 16 - (number % 2) * 5]) for number in range(10)]
    with opened(tmp_path, Written("/a", TYPE, FOO, samples)) as log:
        for start, stop, expected in ((0, 2, 1), (4, 8, 3), (None, None, 5), (3, 9, 5)):
            for _ in range(2):
                log.samples("/a", start=start, stop=stop)
                assert [each.samples for each in log.problems] == [expected]
        list(zip(log.batches(), log.batches(), strict=True))
        next(log.batches())
        assert [(each.samples, each.topic) for each in log.problems] == [(5, "/a")]


@given(st.lists(st.lists(st.integers(0, 5), max_size=8), max_size=5))
def test_passes_are_united(passes: list[list[int]]) -> None:
    """A time counts as often as in the pass that left out the most of it."""
    left_out = LeftOut()
    for times in passes:
        with left_out.reading() as reading:
            for time in times:
                leave_out(reading["/a", 1], "text", np.array([time]))
    expected = sum(max(times.count(time) for times in passes) for time in {time for times in passes for time in times})
    assert [(each.samples, each.topic, each.instance) for each in left_out.problems] == (
        [(expected, "/a", 1)] if expected else []
    )


def test_messages_report_what_they_left_out_when_they_are_not_read_to_the_end(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.Wind
    samples = [
        (START + number, START, cls(timestamp=number).encode()[: 9 if number == 1 else 99]) for number in range(9)
    ]
    topic = Written("/wind", cls.__msg__.ros_type, cls.__msg__.definition, samples)
    with opened(tmp_path, topic) as log:
        messages = log.messages(cls)
        assert [next(messages).timestamp for _ in range(2)] == [0, 2]
        del messages
        assert [each.samples for each in log.problems] == [1]
        assert [(time - START, message.timestamp) for time, message in log.messages(cls, times=True)] == [
            (number, number) for number in range(9) if number != 1
        ]
        assert [each.samples for each in log.problems] == [1]


def test_messages_of_a_ulog_are_those_of_its_array(ulog: Log, tmp_path: Path) -> None:
    definition = ulog.topic("sensor_gps").definition
    package = import_package(catalog_of(tmp_path / "own", {"SensorGps.msg": definition}), tmp_path)
    for instance in (0, 1):
        samples = ulog.samples("sensor_gps", instance=instance)
        found = list(ulog.messages(package.SensorGps, instance=instance, times=True))
        assert [time for time, _ in found] == samples.log_times.tolist()
        assert [each.latitude_deg for _, each in found] == samples.array["latitude_deg"].tolist()
        payloads = list(ulog.payloads([ulog.topic("sensor_gps", instance)]))
        assert [(each.topic, each.time) for each in payloads] == [
            (f"sensor_gps[{instance}]" if instance else "sensor_gps", time) for time in samples.log_times.tolist()
        ]
        assert [package.SensorGps.decode(each.payload) for each in payloads] == [message for _, message in found]


# closed files


@pytest.mark.parametrize("kind", ["ulog", "mcap", "db3"])
def test_reading_a_closed_log_is_an_error(kind: str, tmp_path: Path) -> None:
    path = every_format(tmp_path)[kind]
    with recordings.open(path) as log:
        first = log.topics[0]
        expected = log[first.key].tobytes()
        samples = log.samples(first)
    readers: list[Callable[[], object]] = [
        lambda: log[first.key],
        lambda: log.samples(first, start=0, stop=1),
        log.load,
        lambda: list(log.batches()),
        lambda: list(log.undecoded()),
        log.verify,
        lambda: log.topics[-1].times,
        lambda: list(log.payloads()),
    ]
    for read in readers:
        with pytest.raises(RecordingError, match=f"{path.name} is closed"):
            read()
    assert log.problems == []
    assert samples.array.tobytes() == expected
    log.close()


def test_the_definitions_of_a_closed_log_are_not_searched(tmp_path: Path) -> None:
    with opened(tmp_path, foos("/a", [1], "")) as log:
        pass
    with pytest.raises(RecordingError, match=r"flight\.mcap is closed"):
        assert log.topics


@pytest.mark.parametrize("kind", ["ulog", "mcap", "db3"])
@pytest.mark.parametrize("name", ["batches", "undecoded"])
def test_an_iteration_over_a_log_that_is_closed_ends_with_an_error(kind: str, name: str, tmp_path: Path) -> None:
    log = recordings.open(every_format(tmp_path)[kind])
    running = getattr(log, name)()
    next(running)
    log.close()
    with pytest.raises(RecordingError, match="is closed"):
        list(running)


# times


def test_zero_is_before_all_samples(tmp_path: Path) -> None:
    """Windows that follow one another have every sample once."""
    with opened(tmp_path, foos("/a", [0, 999, 1000, 1001, 2500])) as log:
        assert [len(log.samples("/a", start=start, stop=start + 1)) for start in (0, 1, 2)] == [2, 2, 1]
        assert len(log.samples("/a", start=0)) == len(log["/a"])


@pytest.mark.parametrize("start", [START, 2_000_000_000, 1.79e9, float("inf")])
def test_a_start_in_another_unit_is_refused(tmp_path: Path, start: float) -> None:
    with opened(tmp_path, foos("/a", [0, 4000])) as log:
        for read in (log.load, log.columns, lambda **options: list(log.payloads(**options))):
            with pytest.raises(
                RecordingError, match=r"expected a time in s after the start.* the recording lasts 4.000 s"
            ):
                read(*(["/a"] if read == log.columns else []), start=start)
        assert len(log.samples("/a", start=5)) == 0


def test_times_far_apart_are_not_cut_off(tmp_path: Path) -> None:
    """One sample has the time 0, as a computer without a clock writes it."""
    late = [1_790_000_000 * 10**9 + number * 10**9 for number in range(5)]
    samples = [(time, 0, foo(number)) for number, time in enumerate([0, *late])]
    with opened(tmp_path, Written("/a", TYPE, FOO, samples)) as log:
        assert [len(log.samples("/a", start=1.79e9 + number)) for number in range(5)] == [5, 4, 3, 2, 1]
        assert [len(log.samples("/a", stop=1.79e9 + number)) for number in range(5)] == [1, 2, 3, 4, 5]


def test_partners_are_found_whatever_their_log_times_are(tmp_path: Path) -> None:
    """The second topic is recorded half a second later than the first one."""
    first = foos("/a", range(0, 10_000, 100))
    first.samples = [(time, other, foo((time - START) // 1000)) for time, other, _ in first.samples]
    second = Written("/b", TYPE, FOO, [(time + 500_000_000, other, data) for time, other, data in first.samples])
    with opened(tmp_path, first, second) as log:
        whole = log.align("/a", "/b", tolerance=0.05)
        assert len(whole) == 100
        assert repr(whole) == "<Aligned a, b: 100 rows>"
        for start, stop in ((0, 5), (2, 5), (9, None)):
            part = log.align("/a", "/b", tolerance=0.05, start=start, stop=stop)
            chosen = slice(start * 10, None if stop is None else stop * 10)
            assert part.times.tolist() == whole.times[chosen].tolist()
            assert part.dropped == 0


def test_gaps_between_bursts(tmp_path: Path) -> None:
    bursts = [time for time in [*range(0, 100, 10), *range(300, 400, 10)] for _ in range(3)]
    with opened(tmp_path, foos("/a", bursts)) as log:
        assert [(begin - START, end - START) for begin, end in log.topics[0].gaps] == [(90_000_000, 300_000_000)]
    with opened(tmp_path, foos("/a", [5] * 9)) as log:
        assert log.topics[0].gaps == []


# samples


@pytest.mark.parametrize("kind", ["ulog", "mcap", "db3"])
def test_samples_can_be_sent_to_another_process(kind: str, tmp_path: Path) -> None:
    with recordings.open(every_format(tmp_path)[kind]) as log:
        topic = log.topics[0]
        for samples in (log.samples(topic, fields=["timestamp"]), next(log.batches([topic]))):
            for again in (pickle.loads(pickle.dumps(samples)), copy.deepcopy(samples)):  # noqa: S301 - our own
                assert [values.tobytes() for values in again.columns().values()] == [
                    values.tobytes() for values in samples.columns().values()
                ]
                assert again.log_times.tolist() == samples.log_times.tolist()
                assert list(again.columns()) == list(samples.columns())
                assert (again.topic.name, again.topic.definition) == (topic.name, topic.definition)
                assert log.samples(again.topic).array.tobytes() == log[topic.key].tobytes()
        published = 0 if samples.publish_times is None else samples.publish_times.nbytes
        assert len(pickle.dumps(samples)) < samples.array.nbytes + samples.log_times.nbytes + published + 20_000
        with pytest.raises(RecordingError, match=r"the topic of samples has no times: use log\.topic\("):
            assert samples.topic.times
        assert topic.count == len(topic.times) > 0


def test_samples_do_not_keep_their_log(tmp_path: Path) -> None:
    write_ulog(tmp_path / "flight.ulg")
    log = recordings.open(tmp_path / "flight.ulg")
    kept = [log.samples("sensor_gps"), next(log.batches()), log.load()]
    gone = weakref.ref(log._reader)  # this holds the files
    log.close()
    del log
    gc.collect()
    assert gone() is None
    assert kept


def test_batches_can_be_changed_in_place(ulog: Log) -> None:
    expected = ulog.samples("sensor_gps").log_times.tolist()
    for samples in ulog.batches(["sensor_gps"]):
        samples.log_times[:] -= samples.log_times[0]
        samples.array["fix_type"] = 99
    assert ulog.samples("sensor_gps").log_times.tolist() == expected
    assert not (ulog["sensor_gps"]["fix_type"] == 99).any()


def test_columns_are_in_the_order_of_fields(ulog: Log) -> None:
    chosen = ["esc[1].esc_rpm", "timestamp", "esc[0]"]
    inner = ["timestamp", "esc_rpm", "esc_voltage", "esc_state"]
    names = ["esc[1].esc_rpm", "timestamp", *(f"esc[0].{name}" for name in inner)]
    samples = ulog.samples("esc_status", fields=chosen)
    assert list(samples.columns()) == list(ulog.frame("esc_status", fields=chosen).columns) == names
    whole = ulog.columns("esc_status")
    for name, values in samples.columns().items():
        assert values.tobytes() == whole[name].tobytes()
    assert repr(samples) == f"<Samples of 'esc_status': {COUNT} samples, 4 fields>"


def test_times_are_columns_if_asked_for(ulog: Log, tmp_path: Path) -> None:
    with opened(tmp_path, foos("/a", range(5)), Written("/b", TYPE, "float32 log_time\n")) as log:
        samples, table = log.samples("/a"), log.table("/a", times=True)
        assert samples.publish_times is not None
        columns = log.columns("/a", times=True)
        assert list(columns) == table.column_names == ["log_time", "publish_time", "timestamp", "x"]
        assert columns["log_time"].tolist() == table["log_time"].to_pylist() == samples.log_times.tolist()
        assert columns["publish_time"].tolist() == table["publish_time"].to_pylist() == samples.publish_times.tolist()
        assert table.schema.metadata == log.table("/a").schema.metadata
        assert list(log.columns("/b", times=True)) == ["log_time_", "publish_time", "log_time"]
    columns = ulog.columns("sensor_gps", fields="fix_type", times=True)
    assert list(columns) == ["log_time", "fix_type"]
    assert columns["log_time"].tolist() == ulog.samples("sensor_gps").log_times.tolist()


def test_text_that_is_not_utf_8_is_kept(tmp_path: Path) -> None:
    texts = [b"ok\0", b"\xb0C\0", b"\xff\xfe\0"]
    payloads = [b"\0\1\0\0" + struct.pack("<I", len(text)) + text for text in texts]
    samples = [(START + number, START, payload) for number, payload in enumerate(payloads)]
    with opened(tmp_path, Written("/s", "std_msgs/msg/String", "string data\n", samples)) as log:
        found = log["/s"]["data"].tolist()
        assert [text.encode("utf-8", "surrogateescape") + b"\0" for text in found] == texts
        assert log.table("/s")["data"].to_pylist() == ["ok", "\ufffdC", "\ufffd\ufffd"]
        assert log.frame("/s", "polars")["data"].to_list() == ["ok", "\ufffdC", "\ufffd\ufffd"]
        assert log.problems == []


# wrong arguments


def test_wrong_arguments_are_named(ulog: Log, px4_types: Any, tmp_path: Path) -> None:
    class Foreign:
        """A class of rclpy has no __msg__."""

    for cls in (int, Foreign):
        for topic in (None, "sensor_gps"):
            with pytest.raises(TypeError, match=f"expected the class of a message, got {cls.__name__}"):
                ulog.messages(cls, topic=topic)
    for wrong in (np, "px4_types"):
        with pytest.raises(TypeError, match="expected a generated package such as px4_types, got "):
            ulog.compare(wrong)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="expected a generated package such as px4_types, got numpy"):
        recordings.open(tmp_path / "flight.ulg", np)
    for fields in ([1], [None]):
        with pytest.raises(TypeError, match=r"^fields: expected names, got "):
            ulog.samples("sensor_gps", fields=fields)  # type: ignore[arg-type]
    assert ulog.dtype("esc_status") == ulog["esc_status"].dtype
    assert px4_types


def test_an_unknown_field_is_told_before_samples_are_read(ulog: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ulog, "load", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(RecordingError, match="no field is called 'fix_typ', did you mean 'fix_type'"):
        ulog.columns("sensor_gps", fields=["fix_typ"])


def test_a_topic_called_time_can_be_aligned(tmp_path: Path) -> None:
    with opened(tmp_path, foos("/time", range(3)), foos("/b", range(3))) as log:
        aligned = log.align("/time", "/b", tolerance=1)
        assert aligned.array.dtype.names == ("time", "time_", "b")
        assert list(aligned.columns()) == ["time", "time_.timestamp", "time_.x", "b.timestamp", "b.x"]


def test_the_topic_of_an_offset_can_be_a_key(tmp_path: Path) -> None:
    samples = [(START + number * 10**7, START, foo(number, number / 7)) for number in range(50)]
    with opened(tmp_path, Written("/a", TYPE, FOO, samples)) as log:
        for key in ("/a", ("/a", 0), log.topic("/a")):
            assert offset_between(log, log, key).offset == 0  # type: ignore[arg-type]


def test_the_public_names_are_listed() -> None:
    code = "from msggen import recordings; assert set(recordings.__all__) <= set(dir(recordings))"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("package", ["numpy", "zstandard"])
def test_a_missing_package_names_the_extra(package: str, tmp_path: Path) -> None:
    path = write_log(tmp_path / "flight.mcap", [foos("/a", [1])])
    code = (
        f"import sys; sys.modules[{package!r}] = None\n"
        f"from msggen import recordings\nrecordings.open({str(path)!r})['/a']"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    expected = f"ModuleNotFoundError: the package {package} is not installed: {installing('recordings')}"
    assert done.stderr.splitlines()[-1] == expected


def test_problems_name_the_instance(tmp_path: Path) -> None:
    writer = UlogWriter()
    writer.format("foo", "uint64_t timestamp;float x")
    for instance in (0, 1):
        writer.subscribe(instance, "foo", instance)
        writer.sample(instance, struct.pack("<Qf", 2_000_000, 1.0))
    writer.sample(1, struct.pack("<QH", 3_000_000, 1))
    with recordings.open(writer.write(tmp_path / "flight.ulg")) as log:
        (problem,) = log.problems
        assert (problem.topic, problem.instance, problem.samples) == ("foo", 1, 1)
        assert problem_text(problem).startswith("foo[1]: 10 bytes, expected 12: ")


def test_a_table_is_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "vehicle_status.parquet"
    path.write_bytes(b"PAR1 and the rest of a table")
    with pytest.raises(RecordingError, match="is a table in Parquet, not a recording"):
        recordings.open(path)
