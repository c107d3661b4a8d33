"""Tests of samples as messages of a generated class, and of its definition compared with the recorded one."""

from __future__ import annotations

import re
from pathlib import Path
from random import Random
from typing import Any

import pytest

from msggen import recordings
from msggen.base.location import Location
from msggen.definitions.identity import message_hash
from msggen.recordings import RecordingError
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import EMBEDDED, Releases
from msggen.sources.finding import find_sources, with_archived
from msggen.sources.released import embedded
from support.catalogs import catalog_of, import_package
from support.examples import by_day
from support.log_files import Written, definition_in, opened
from support.written import write_recording

START = 1_790_000_000_000_000_000
HEADER = b"\0\1\0\0"


@pytest.fixture(scope="module")
def archived(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The package of the newest release with its archived versions."""
    sources = with_archived(find_sources(EMBEDDED[0]), Location("archived", 0))
    return import_package(read_catalog(sources), tmp_path_factory.mktemp("archived"))


def payloads_of(cls: Any, count: int, seed: int = 1) -> list[bytes]:
    """Return samples of random bytes."""
    chance = Random(seed)  # noqa: S311 - no secret
    size = cls.__msg__.cdr_size
    return [HEADER + chance.randbytes(size) for _ in range(count)]


def written(cls: Any, topic: str, payloads: list[bytes], **options: Any) -> Written:
    """Return a topic with samples 1 s apart."""
    info = cls.__msg__
    samples = [(START + number * 10**9, START, payload) for number, payload in enumerate(payloads)]
    return Written(topic, info.ros_type, info.definition, samples, **options)


@pytest.mark.parametrize("name", ["VehicleOdometry", "EscStatus", "SensorGps", "VehicleStatus"])
@pytest.mark.parametrize("options", [{}, {"use_chunking": False}])
def test_messages_are_the_decoded_payloads(px4_types: Any, name: str, options: dict[str, Any], tmp_path: Path) -> None:
    cls = getattr(px4_types, name)
    payloads = payloads_of(cls, 20)
    with opened(tmp_path, written(cls, "/fmu/out/mine", payloads), **options) as log:
        assert list(log.messages(cls)) == [cls.decode(payload) for payload in payloads]
        assert list(log.messages(cls, start=3, stop=7)) == [cls.decode(payload) for payload in payloads[3:7]]
        assert [each.timestamp for each in log.messages(cls)] == log["/fmu/out/mine"]["timestamp"].tolist()
        assert log.problems == []


@pytest.mark.parametrize("wrong", ["vehicle_attitude", None, 3])
def test_what_is_no_class_is_refused(wrong: Any, px4_types: Any, tmp_path: Path) -> None:
    path = write_recording(tmp_path / "a.mcap", [("/fmu/out/wind", 0.0, px4_types.Wind())])
    with (
        recordings.open(path) as log,
        pytest.raises(TypeError, match=f"^expected the class of a message, got {wrong!r}$"),
    ):
        log.messages(wrong)


def test_messages_are_in_the_order_of_their_times(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.Wind
    first, second = (written(cls, "/fmu/out/wind", payloads_of(cls, 9, seed)) for seed in (1, 2))
    second.samples = [(time + 5 * 10**8, other, payload) for time, other, payload in second.samples]
    with opened(tmp_path, first, second) as log:
        expected = sorted([*first.samples, *second.samples])
        assert list(log.messages(cls)) == [cls.decode(payload) for *_, payload in expected]


def test_what_is_not_a_sample_is_left_out_and_counted(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.Wind
    payloads = payloads_of(cls, 6)
    broken = [*payloads[:2], payloads[2][:-9], b"", b"\xff\xff\0\0" + payloads[3][4:], *payloads[4:]]
    with opened(tmp_path, written(cls, "/fmu/out/wind", broken)) as log:
        for _ in range(2):
            assert list(log.messages(cls)) == [cls.decode(payloads[index]) for index in (0, 1, 4, 5)]
            assert [(each.topic, each.samples) for each in log.problems] == [("/fmu/out/wind", 3)]


def test_messages_of_variable_size(tmp_path: Path) -> None:
    files = {"Named.msg": "uint64 timestamp\nstring name\nfloat32[] values\n"}
    package = import_package(catalog_of(tmp_path / "definitions", files), tmp_path)
    payloads = [package.Named(timestamp=n, name="a" * n, values=[float(n)] * n).encode() for n in range(5)]
    with opened(tmp_path, written(package.Named, "/named", payloads)) as log:
        assert [each.encode() for each in log.messages(package.Named)] == payloads


def test_the_topic_of_a_class(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.VehicleOdometry
    out, mocap, visual = (payloads_of(cls, 2, seed) for seed in (1, 2, 3))
    names = ("/fmu/in/vehicle_mocap_odometry", "/fmu/in/vehicle_visual_odometry")
    inputs = [written(cls, name, payloads) for name, payloads in zip(names, (mocap, visual), strict=True)]
    with opened(tmp_path, *inputs) as log:
        with pytest.raises(RecordingError, match=re.escape(f"'{names[0]}', '{names[1]}': name one with topic=")):
            log.messages(cls)
        assert next(log.messages(cls, topic="vehicle_visual_odometry")) == cls.decode(visual[0])
        with pytest.raises(RecordingError, match="no topic is called 'vehicle_odometry'"):
            log.messages(cls, topic="vehicle_odometry")
        with pytest.raises(RecordingError, match="has no topic of px4_msgs/msg/Wind"):
            log.messages(px4_types.Wind)
        with pytest.raises(RecordingError, match="has no instance 1, it has: 0, 0"):
            log.messages(cls, instance=1)
    with opened(tmp_path, *inputs, written(cls, "/fmu/out/vehicle_odometry", out)) as log:
        assert next(log.messages(cls)) == cls.decode(out[0])


def test_a_class_of_another_definition_is_refused(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.AirspeedValidated
    old = Written(
        "/fmu/out/airspeed_validated",
        "px4_msgs/msg/AirspeedValidated",
        definition_in("v1.16", "AirspeedValidated"),
        [(START, START, payloads_of(cls, 1)[0])],
    )
    with opened(tmp_path, old) as log:
        expected = (
            "'/fmu/out/airspeed_validated' has another definition than px4_types.AirspeedValidated: "
            "'int8 airspeed_source' at byte 20 is not in the recording, and 4 more; build a package of the recording: "
            f"msggen build --px4 {log.path} --package recorded_types"
        )
        with pytest.raises(RecordingError, match=re.escape(expected)):
            log.messages(cls)


def test_a_topic_with_an_unreadable_definition_is_refused(px4_types: Any, tmp_path: Path) -> None:
    with (
        opened(tmp_path, Written("/fmu/out/wind", "px4_msgs/msg/Wind", "Nested it\n")) as log,
        pytest.raises(RecordingError, match="cannot be read: "),
    ):
        log.messages(px4_types.Wind)


def test_a_topic_without_a_definition_is_read_with_one_that_fits(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.Wind
    payloads = payloads_of(cls, 3)
    unknown = written(cls, "/fmu/out/wind", payloads)
    unknown.definition = ""
    with opened(tmp_path, unknown) as log:
        assert list(log.messages(cls)) == [cls.decode(payload) for payload in payloads]
        assert log.topic("wind").recorded_definition == ""
        assert not log.release().releases


def test_a_type_hash_is_enough(px4_types: Any, tmp_path: Path) -> None:
    cls = px4_types.Wind
    payloads = payloads_of(cls, 3)
    known = written(cls, "/fmu/out/wind", payloads, metadata={"topic_type_hash": cls.__msg__.type_hash})
    known.definition = ""
    with opened(tmp_path, known) as log:
        assert list(log.messages(cls)) == [cls.decode(payload) for payload in payloads]
        (compared,) = log.compare(px4_types)
        assert compared.is_same
    known.metadata = {"topic_type_hash": "RIHS01_0"}
    with opened(tmp_path, known) as log, pytest.raises(RecordingError, match="has another definition than"):
        log.messages(cls)


def test_another_version_is_converted(archived: Any, tmp_path: Path) -> None:
    new, old = archived.VehicleStatus, archived.VehicleStatusV1
    payloads = [old(timestamp=n, system_id=7, nav_state=21).encode() for n in range(4)]
    with opened(tmp_path, written(old, "/fmu/out/vehicle_status_v1", payloads)) as log:
        text = f"'/fmu/out/vehicle_status_v1' has the definition of VehicleStatusV1, and {archived.__name__}.Vehicle"
        with pytest.raises(RecordingError, match=re.escape(text)):
            log.messages(new)
        assert [each.encode() for each in log.messages(old)] == payloads
        converted = list(log.messages(new, convert=True))
        expected = [archived.versions.convert(old.decode(payload), new).message for payload in payloads]
        assert converted == expected
        assert {type(each) for each in converted} == {new}
        (compared,) = log.compare(archived)
        assert (compared.message, str(compared)) == (
            old,
            "/fmu/out/vehicle_status_v1: VehicleStatusV1: the same definition",
        )


# comparison


@by_day("release", EMBEDDED[::-1], 5)
def test_topics_are_compared_by_the_rules_of_check(px4_types: Any, release: str, tmp_path: Path) -> None:
    names = [name for name in px4_types.msg.__all__ if Releases().file(release, f"{name}.msg")[0]]
    topics = [Written(f"/{name}", f"px4_msgs/msg/{name}", definition_in(release, name)) for name in names]
    with opened(tmp_path, *topics) as log:
        found = {each.topic.name[1:]: each for each in log.compare(px4_types)}
    assert found.keys() == set(names)
    for name in names:
        released = embedded(release, name)
        assert released is not None
        info, each = getattr(px4_types, name).__msg__, found[name]
        assert each.is_same == (message_hash(*released) == info.message_hash)
        assert each.is_same or each.findings
        assert each.is_silent <= each.is_misread <= (not each.is_same)
        subjects = {finding.change.subject for finding in each.findings}
        assert not subjects or name in subjects
    assert (release == EMBEDDED[0]) == all(each.is_same for each in found.values())


def test_what_was_not_compared_says_why(px4_types: Any, tmp_path: Path) -> None:
    topics = [
        Written("/a", "px4_msgs/msg/Wind", ""),
        Written("/b", "px4_msgs/msg/Mine", "uint8 a\n"),
        Written("/c", "px4_msgs/msg/Wind", "Mine a\n"),
        Written("/d", "px4_msgs/msg/Wind", "", metadata={"topic_type_hash": "RIHS01_0"}),
        Written("/e", "px4_msgs/msg/Wind", definition_in("v1.18", "Wind").replace("innov_var", "innov_variance")),
    ]
    with opened(tmp_path, *topics) as log:
        shown = list(map(str, log.compare(px4_types)))
    assert shown == [
        "/a: the recording has no definition",
        "/b: px4_types has no px4_msgs/msg/Mine",
        "/c: its definition cannot be read: Wind.a: there is no definition of Mine",
        "/d: another type hash than px4_types, and no definition",
        "/e: Wind: other names: 'tas_innov_var' is called 'tas_innov_variance' in flight.mcap, and 1 more",
    ]
