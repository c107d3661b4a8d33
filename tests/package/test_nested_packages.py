"""Tests of a generated package with messages of other ROS packages: their location, and the same behaviour as uORB's.

Messages with the same name occur in every combination: side by side in one message, one inside the other, in arrays
and in services. tests/sources/test_other_packages.py tests how packages are found and which rules apply.
"""

from __future__ import annotations

import copy
import dataclasses
import importlib
import pickle
import subprocess
import sys
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from msggen.definitions.layout import is_static
from msggen.definitions.model import Catalog, Message
from msggen.generate.python.package import list_package, render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import import_package, write_definitions
from support.nested_packages import sources
from support.other_codecs import everything
from support.random_definitions import values_of
from support.reference import HEADERS, serialize, to_object, to_values


@pytest.fixture(scope="module")
def catalog(tmp_path_factory: pytest.TempPathFactory) -> Catalog:
    return sources(tmp_path_factory.mktemp("definitions"))


@pytest.fixture(scope="module")
def package(catalog: Catalog, tmp_path_factory: pytest.TempPathFactory) -> Any:
    return import_package(catalog, tmp_path_factory.mktemp("package"))


def class_of(package: Any, catalog: Catalog, message: Message) -> Any:
    home = package.__name__ + ("" if message.package == catalog.package else f".{message.package}")
    return getattr(importlib.import_module(f"{home}.{message.folder}"), message.name)


# --- Location of the classes


def test_each_package_has_a_place_of_its_own(package: Any) -> None:
    pose = importlib.import_module(f"{package.__name__}.geometry_msgs.msg").Pose
    assert package.geometry_msgs.msg.Pose is pose
    assert pose.__module__ == f"{package.__name__}.geometry_msgs.msg._pose"
    assert package.std_srvs.srv.SetBool.Request is package.std_srvs.srv.SetBool_Request
    assert package.my_msgs.srv.Aim.Response.__msg__.ros_type == "my_msgs/srv/Aim_Response"
    assert package.Rig is package.msg.Rig is not package.my_msgs.msg.Rig


def test_uorbs_package_does_not_have_the_messages_of_others(package: Any) -> None:
    assert not hasattr(package, "Pose")
    assert not hasattr(package.msg, "Pose")
    assert {"Rig", "geometry_msgs", "my_msgs", "std_srvs"} <= {*dir(package)} & {*package.__all__}
    assert dir(package.my_msgs) == ["msg", "srv"]
    assert dir(package.std_srvs) == ["srv"]
    assert [*package.topics.UORB] == ["named", "rig", "rpm"]


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("std_msgs.msg.Heder", "has no message 'Heder', did you mean 'Header'?"),
        ("std_msgs.Header", "module '{0}.std_msgs' has no attribute 'Header'"),
        ("std_srvs.msg", "module '{0}.std_srvs' has no attribute 'msg'"),
    ],
)
def test_what_is_not_there_is_an_attribute_error(package: Any, path: str, text: str) -> None:
    with pytest.raises(AttributeError) as caught:
        eval(f"package.{path}", {"package": package})  # noqa: S307 - our own text
    assert text.format(package.__name__) in str(caught.value)


def test_what_nobody_asks_for_is_not_imported(catalog: Catalog, tmp_path: Path) -> None:
    for name, text in render_package(catalog, "types").items():
        write_definitions(tmp_path / "px4_types", {name: text})
    program = (
        "import sys\n"
        "def own(): return {name for name in sys.modules if name.startswith('px4_types.')}\n"
        "import px4_types; print(*own())\n"
        "from px4_types import Rpm; print(*own())\n"
        "from px4_types.std_msgs.msg import Header; print(*own())\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    first, second, third = ({*line.replace("px4_types.", "").split()} for line in done.stdout.split("\n")[:3])
    assert first == set()
    assert second == {"cdr", "msg", "msg._rpm"}
    assert {name for name in third - second if "_msgs" in name or "_interfaces" in name} == {
        "std_msgs",
        "std_msgs.msg",
        "std_msgs.msg._header",
        "builtin_interfaces",
        "builtin_interfaces.msg",
        "builtin_interfaces.msg._time",
    }


def test_the_list_of_files_is_that_of_what_is_made(catalog: Catalog) -> None:
    assert list_package(catalog) == tuple(render_package(catalog, "types"))


@pytest.mark.parametrize("files", [{"std_msgs/msg/Empty.msg": ""}, {"std_srvs/srv/Empty.srv": "---\n"}], ids=str)
def test_a_package_without_a_message_of_uorb_has_no_topics(files: dict[str, str], tmp_path: Path) -> None:
    (path,) = files
    name = path.split("/")[0]
    write_definitions(tmp_path, files)
    alone = import_package(read_catalog(find_sources(None, (f"{name}={tmp_path / name}",))), tmp_path)
    assert alone.msg.__all__ == []
    assert ([*alone.topics.ORB_ID], alone.topics.UORB, alone.topics.ENDPOINTS) == ([], {}, ())
    assert (getattr(alone, name).msg if "msg" in path else getattr(alone, name).srv).Empty


def test_services_alone_make_a_package_too(tmp_path: Path) -> None:
    write_definitions(tmp_path / "in", {"srv/Ask.srv": "uint8 a\n---\nuint8 b\n"})
    alone = import_package(read_catalog(find_sources(str(tmp_path / "in"))), tmp_path)
    assert alone.srv.Ask.Request(a=1).a == 1
    assert alone.msg.__all__ == []


# --- Information in the classes


def test_types_are_spelled_as_the_definition_spells_them(package: Any) -> None:
    types = [field.type for field in package.Rig.__msg__.fields]
    assert types[1:3] == ["geometry_msgs/Pose[3]", "builtin_interfaces/Time"]
    assert types[-3:] == ["my_msgs/Time", "my_msgs/Time[5]", "Rpm"]
    track = [(field.base, field.length) for field in package.my_msgs.msg.Track.__msg__.fields]
    assert track == [("Twist", 2), ("my_msgs/Twist", None), ("px4_msgs/Rpm", None)]


def test_classes_of_one_name_are_told_apart_by_their_package_and_others_keep_theirs(package: Any) -> None:
    names = vars(sys.modules[package.Rig.__module__])
    assert names["builtin_interfaces_Time"] is package.builtin_interfaces.msg.Time
    assert names["my_msgs_Time"] is package.my_msgs.msg.Time
    assert names["Pose"] is package.geometry_msgs.msg.Pose
    assert "Time" not in names
    names = vars(sys.modules[package.my_msgs.msg.Time.__module__])
    assert names["Time"] is package.my_msgs.msg.Time
    assert names["builtin_interfaces_Time"] is package.builtin_interfaces.msg.Time


def test_what_only_uorb_knows_is_left_empty(package: Any) -> None:
    info = package.my_msgs.msg.Track.__msg__
    assert (info.topics, info.struct_size) == ((), None)
    assert (info.ros_type, info.dds_type) == ("my_msgs/msg/Track", "my_msgs::msg::dds_::Track_")
    assert package.Rig.__msg__.topics == ("rig",)


def test_defaults_of_definitions_hold_in_every_package(package: Any) -> None:
    assert package.geometry_msgs.msg.Quaternion().w == 1.0
    assert package.Rig().poses[2].orientation.w == 1.0


# --- Bytes


def test_every_message_of_every_package_equals_the_reference(package: Any, catalog: Catalog) -> None:
    for message in everything(catalog):
        cls = class_of(package, catalog, message)
        for seed in range(5):
            values = values_of(catalog, message, Random(seed))  # noqa: S311 - not used for security
            sample = cls.decode(serialize(catalog, message, values, "little", 1))
            for encoding, header in HEADERS.items():
                expected = serialize(catalog, message, values, *encoding)
                assert package.encapsulation.encode_as(sample, header[:2]) == expected
                assert repr(to_values(catalog, message, cls.decode(expected))) == repr(values)


def samples(package: Any, catalog: Catalog, cls: Any) -> list[Any]:
    """Return five messages with random values."""
    message = catalog.messages[cls.__msg__.ros_type.replace("/msg/", "/")]
    drawn = (values_of(catalog, message, Random(seed)) for seed in range(5))  # noqa: S311 - not used for security
    return [to_object(package, catalog, message, values) for values in drawn]


# --- Other methods of a message


def static_classes(package: Any, catalog: Catalog) -> list[Any]:
    return [class_of(package, catalog, each) for each in catalog.messages.values() if is_static(catalog, each)]


def test_views_read_what_is_nested_at_any_depth(package: Any, catalog: Catalog) -> None:
    for cls in static_classes(package, catalog):
        for message in samples(package, catalog, cls):
            view = cls.lazy(message.encode())
            assert view == message
            assert repr(view) == repr(cls.decode(message.encode()))
            assert pickle.loads(pickle.dumps(view)) == message  # noqa: S301 - our own bytes
    view = package.Rig.lazy(package.Rig().encode())
    assert isinstance(view.stamp, package.builtin_interfaces.msg.Time)
    assert isinstance(view.others[4], package.my_msgs.msg.Time)
    assert isinstance(view.others[4].two[1], package.builtin_interfaces.msg.Time)


def test_batches_hold_what_is_nested_at_any_depth(package: Any, catalog: Catalog) -> None:
    for cls in static_classes(package, catalog):
        messages = samples(package, catalog, cls)
        payloads = [message.encode() for message in messages]
        array = cls.decode_batch(payloads)
        assert array.dtype == cls.dtype()
        assert cls.encode_batch(array) == payloads
        assert [cls.from_row(row) for row in array] == messages
    rigs = samples(package, catalog, package.Rig)
    array = package.Rig.decode_batch(b"".join(rig.encode() for rig in rigs))
    assert array["others"]["two"]["sec"].shape == (5, 5, 2)
    columns = package.batch.columns(array)
    expected = [rig.others[4].two[1].sec for rig in rigs]
    assert np.array_equal(columns["others[4].two[1].sec"], expected)


def test_messages_are_copied_pickled_and_taken_apart(package: Any, catalog: Catalog) -> None:
    for cls in (package.Rig, package.my_msgs.msg.Log, package.my_msgs.msg.Track, package.my_msgs.msg.Header):
        for message in samples(package, catalog, cls):
            assert copy.deepcopy(message) == message
            assert pickle.loads(pickle.dumps(message)) == message  # noqa: S301 - our own bytes
            assert dataclasses.replace(message) == message
    rig = package.Rig(other=package.my_msgs.msg.Time(a=7))
    assert dataclasses.asdict(rig)["other"]["two"] == ({"sec": 0, "nanosec": 0},) * 2
    assert [field.name for field in dataclasses.fields(package.my_msgs.msg.Time)] == ["a", "stamp", "two"]
    match rig:
        case package.Rig(other=package.my_msgs.msg.Time(a=7)):
            pass
        case _:
            pytest.fail("a nested message of another package does not match")


def test_messages_of_the_same_name_are_not_the_same(package: Any) -> None:
    point, vector = package.geometry_msgs.msg.Point(), package.geometry_msgs.msg.Vector3()
    assert point.encode() == vector.encode()
    assert point != vector
    assert package.builtin_interfaces.msg.Time() != package.my_msgs.msg.Time()
    assert package.builtin_interfaces.msg.Time() != package.builtin_interfaces.msg.Duration()


def test_a_message_of_the_same_name_is_no_value_for_a_field(package: Any) -> None:
    mine, theirs = package.my_msgs.msg.Time, package.builtin_interfaces.msg.Time
    for wrong, text in (
        (package.Rig(stamp=mine()), "Rig.stamp: expected builtin_interfaces/Time, got my_msgs/msg/Time"),
        (package.Rig(other=theirs()), "Rig.other: expected my_msgs/Time, got builtin_interfaces/msg/Time"),
        (package.Rig(others=(mine(),) * 4 + (theirs(),)), "Rig.others[4]: expected my_msgs/Time, got builtin"),
        (mine(stamp=mine()), "Time.stamp: expected builtin_interfaces/Time, got my_msgs/msg/Time"),
        (package.my_msgs.msg.Log(time=theirs()), "Log.time: expected Time, got builtin_interfaces/msg/Time"),
    ):
        with pytest.raises(package.EncodeError) as caught:
            wrong.encode()
        assert str(caught.value).startswith(text)


def test_errors_name_the_value_at_any_depth(package: Any) -> None:
    geometry, mine = package.geometry_msgs.msg, package.my_msgs.msg
    invalid = geometry.Pose(position=geometry.Point(y="1"))
    late = mine.Time(two=(package.builtin_interfaces.msg.Time(), package.builtin_interfaces.msg.Time(sec=2**31)))
    for wrong, text in (
        (package.Rig(poses=(geometry.Pose(), invalid, geometry.Pose())), "Rig.poses[1].position.y: expected float64"),
        (package.Rig(others=(mine.Time(),) * 4 + (late,)), "Rig.others[4].two[1].sec: expected int32"),
        (package.Rig(poses=(1, 2, 3)), "Rig.poses[0]: expected geometry_msgs/Pose, got 1"),
        (mine.Log(mine=[mine.Header()] * 4), "Log.mine: expected up to 3 values, got 4"),
        (mine.Log(headers=[mine.Header()]), "Log.headers[0]: expected std_msgs/Header, got my_msgs/msg/Header"),
    ):
        with pytest.raises(package.EncodeError) as caught:
            wrong.encode()
        assert str(caught.value).startswith(text)
    with pytest.raises(package.DecodeError, match=r"Rig\.others: expected"):
        package.Rig.decode(package.Rig().encode()[:-40])


def test_subclasses_find_what_their_base_nests(package: Any) -> None:
    class Mine(package.Rig):  # type: ignore[misc]
        """A user's class, in a module that imports none of the nested messages."""

    sample = package.Rig(kind=3).encode()
    assert Mine.lazy(sample).others[0].stamp.sec == 0
    assert Mine.decode_batch([sample])["kind"].tolist() == [3]
    with pytest.raises(package.EncodeError, match="expected my_msgs/Time, got 5"):
        Mine(other=5).encode()
