"""The definitions of service events, which `ros2 bag record --services` writes: `/set_mode/_service_event`.

Their type, such as `std_srvs/srv/SetBool_Event`, has no file of its own: rosidl derives it from the service. rosbag2
stores the text of the `.srv` under a head `SRV:`, with the encoding `ros2msg`, or `unknown` if the service nests no
messages (rosbag2_cpp/message_definitions/local_message_definition_source.cpp).
"""

from __future__ import annotations

import re

from msggen.recordings.source.source import SEPARATOR

_HEAD = re.compile(r"=+[ \t\r]*\nSRV:[ \t]*(\S+)[ \t\r]*\n")
_NESTED = re.compile(r"^=+[ \t\r]*\n(?=MSG:)", re.MULTILINE)
_MARK = re.compile(r"^[ \t]*---[ \t\r]*$", re.MULTILINE)

_EVENT = """\
service_msgs/ServiceEventInfo info
{0}_Request[<=1] request
{0}_Response[<=1] response
"""
_INFO = {
    "service_msgs/ServiceEventInfo": """\
uint8 REQUEST_SENT=0
uint8 REQUEST_RECEIVED=1
uint8 RESPONSE_SENT=2
uint8 RESPONSE_RECEIVED=3
uint8 event_type
builtin_interfaces/Time stamp
char[16] client_gid
int64 sequence_number
""",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
}


def is_service(text: str) -> bool:
    """Whether a recorded definition is that of a service."""
    return _HEAD.match(text) is not None


def event_definition(ros_type: str, text: str) -> str:
    """Return the definition of an event in the format `ros2msg`, from that of its service; other texts unchanged."""
    head = _HEAD.match(text)
    name = ros_type.rpartition("/")[2].removesuffix("_Event")
    if head is None or ros_type != f"{head[1]}_Event":
        return text
    own, *others = _NESTED.split(text[head.end() :])
    halves = _MARK.split(own, maxsplit=1)
    package = ros_type.partition("/")[0]
    known = {f"MSG: {key}" for key in _INFO}
    nested = {f"{package}/srv/{name}_{half}": body for half, body in zip(("Request", "Response"), halves, strict=False)}
    nested |= _INFO
    texts = [f"MSG: {key}\n{body.strip()}\n" for key, body in nested.items()]
    texts += [each for each in others if each.partition("\n")[0].strip() not in known]
    return _EVENT.format(name) + "".join(f"{SEPARATOR}\n{each}" for each in texts)
