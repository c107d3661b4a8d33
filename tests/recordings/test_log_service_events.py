"""Tests of service events, as rosbag2 writes them: their definitions, hashes, and samples that rosbags serializes.

The type hashes are those that rosidl_generator_type_description 4.9.5 computed of the services.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msggen import recordings
from msggen.cli import main
from msggen.recordings.decode.schemas import type_hash_of
from msggen.recordings.files.mcap.channels import event_definition
from support.databases import Stored, write_database
from support.log_files import Written, write_log

LINE = "=" * 80
PLACE = "float64 x\nstring name\n"
SERVICES = {
    "Add": ("int64 a\nint64 b\n", "int64 sum\n"),
    "Go": ("Place[] places\nbool fast\n", ""),
    "Empty": ("", ""),
}
HASHES = {
    "Add": "RIHS01_d37c957aafa70539cd3d10bd104222865122873a15fb4a2963bfc4ae0cfc5e1c",
    "Go": "RIHS01_5c38f59eacd107c7aed13b560029fde77b3007ea2bbcda7cf40a600714697a9e",
    "Empty": "RIHS01_374add18dd247c7cf008e3ca2d963621867d8ec2d410506e544b2ff209e71bc9",
}
START = 1_790_000_000_000_000_000


def recorded(name: str) -> tuple[str, str]:
    """Return the encoding and the text of a definition as rosbag2 writes it."""
    request, response = SERVICES[name]
    own = f"{LINE}\nSRV: my_srvs/srv/{name}\n{request}---\n{response}"
    return ("ros2msg", f"{own}\n{LINE}\nMSG: my_srvs/Place\n{PLACE}") if "Place" in request else ("unknown", own)


def store() -> Any:
    """Return rosbags' types, with the messages that rosidl derives from the services."""
    found = get_typestore(Stores.ROS2_JAZZY)
    types = get_types_from_msg(PLACE, "my_srvs/msg/Place")
    for name, (request, response) in SERVICES.items():
        types |= get_types_from_msg(request.replace("Place", "my_srvs/msg/Place"), f"my_srvs/msg/{name}_Request")
        types |= get_types_from_msg(response, f"my_srvs/msg/{name}_Response")
        event = f"service_msgs/msg/ServiceEventInfo info\nmy_srvs/msg/{name}_Request[<=1] request\n"
        types |= get_types_from_msg(f"{event}my_srvs/msg/{name}_Response[<=1] response\n", f"my_srvs/msg/{name}_Event")
    found.register(types)
    return found


def events(name: str) -> list[bytes]:
    """Return a request and a response, serialized."""
    known = store()
    make = {key.rpartition("/")[2]: cls for key, cls in known.types.items()}

    def event(number: int, **halves: Any) -> bytes:
        info = make["ServiceEventInfo"](number, make["Time"](1, 2), np.arange(16, dtype=np.uint8), 7)
        message = make[f"{name}_Event"](info, **{"request": [], "response": [], **halves})
        return bytes(known.serialize_cdr(message, f"my_srvs/msg/{name}_Event"))

    requests = {
        "Add": lambda: make["Add_Request"](3, 4),
        "Go": lambda: make["Go_Request"]([make["Place"](1.5, "hangar"), make["Place"](2.5, "runway")], fast=True),
        "Empty": make["Empty_Request"],
    }
    response = make["Add_Response"](7) if name == "Add" else make[f"{name}_Response"]()
    return [event(0, request=[requests[name]()]), event(3, response=[response])]


@pytest.mark.parametrize("name", SERVICES)
def test_the_hash_is_that_of_rosidl(name: str) -> None:
    ros_type = f"my_srvs/srv/{name}_Event"
    assert type_hash_of(ros_type, event_definition(ros_type, recorded(name)[1])) == HASHES[name]


def check(path: Path) -> None:
    with recordings.open(path) as log:
        assert (log.problems, log.notes) == ([], [])
        added, answered = log["/add/_service_event"]
        assert added["info"][["event_type", "sequence_number"]].tolist() == (0, 7)
        assert (added["request"], added["response"]) == ([{"a": 3, "b": 4}], [])
        assert (answered["request"], answered["response"]) == ([], [{"sum": 7}])
        went, _ = log["/go/_service_event"]
        assert went["request"] == [
            {"places": [{"x": 1.5, "name": "hangar"}, {"x": 2.5, "name": "runway"}], "fast": True}
        ]
        assert log["/empty/_service_event"]["request"].tolist() == [[{}], []]
        assert log.topic("/go/_service_event").type_hash == HASHES["Go"]


def mcap(path: Path) -> Path:
    topics = []
    for name in SERVICES:
        format_, text = recorded(name)
        samples = [(START + number, START + number, payload) for number, payload in enumerate(events(name))]
        metadata = {"topic_type_hash": HASHES[name]}
        topics.append(
            Written(
                f"/{name.lower()}/_service_event",
                f"my_srvs/srv/{name}_Event",
                text,
                samples,
                format=format_,
                metadata=metadata,
            )
        )
    return write_log(path, topics)


def test_events_in_mcap_are_decoded(tmp_path: Path) -> None:
    check(mcap(tmp_path / "flight.mcap"))


def test_events_in_a_database_are_decoded(tmp_path: Path) -> None:
    path = tmp_path / "flight.db3"
    topics = [
        Stored(
            number, f"/{name.lower()}/_service_event", f"my_srvs/srv/{name}_Event", recorded(name)[1], type_hash=value
        )
        for number, (name, value) in enumerate(HASHES.items(), 1)
    ]
    rows = [(number, START, payload) for number, name in enumerate(HASHES, 1) for payload in events(name)]
    write_database(path, topics, rows)
    with sqlite3.connect(path) as base:
        for name in HASHES:
            values = recorded(name)[0], f"my_srvs/srv/{name}_Event"
            base.execute("UPDATE message_definitions SET encoding = ? WHERE topic_type = ?", values)
    base.close()
    check(path)


def test_a_converted_event_has_the_definition_of_its_messages(tmp_path: Path) -> None:
    target = tmp_path / "new.mcap"
    assert main(["log", "convert", str(mcap(tmp_path / "flight.mcap")), "-o", str(target)]) == 0
    check(target)
    with target.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    schemas = {schema.name: (schema.encoding, schema.data) for schema in summary.schemas.values()}
    encoding, data = schemas["my_srvs/srv/Add_Event"]
    assert (encoding, data.count(b"MSG: my_srvs/srv/Add_Re")) == ("ros2msg", 2)


def test_damaged_definitions_of_services_are_no_definitions(tmp_path: Path) -> None:
    for text in (
        f"{LINE}\nSRV: my_srvs/srv/Add\n",
        f"{LINE}\nSRV: other/srv/Add\nint64 a\n---\n",
        f"{LINE}\nSRV:\n---\n",
    ):
        sample = [(START, START, events("Add")[0])]
        topic = Written("/add/_service_event", "my_srvs/srv/Add_Event", text, sample, format="unknown")
        with recordings.open(write_log(tmp_path / "flight.mcap", [topic])) as log:
            assert [topic.name for topic in log.topics] == ["/add/_service_event"]
            with pytest.raises(recordings.RecordingError, match="/add/_service_event"):
                log["/add/_service_event"]
