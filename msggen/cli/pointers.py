"""What msggen has instead of words of other programs: ROS 2, MAVSDK, pyulog, MicroXRCEAgent and PX4's shell.

It is imported only for a word that msggen does not know.
"""

from __future__ import annotations

from collections.abc import Mapping

ACTIONS: Mapping[str, str] = {
    **dict.fromkeys(("info", "show", "plot", "report", "convert", "compact", "cut", "merge", "repair"), "log"),
    **dict.fromkeys(("echo", "hz", "bw", "delay", "list", "pub", "type", "find"), "topic"),
}
"""The commands of actions that users type without them."""

SYNONYMS: Mapping[str, str] = {"show": "info"}
"""What an action is called otherwise in ROS 2, for suggestions."""

_NO_AGENT = "no agent is needed: PX4's client connects to msggen; `msggen doctor --link udp://0.0.0.0:8888` shows it"
_PARAMETERS = "parameters are set with QGroundControl or MAVSDK; `msggen log show FILE --params` prints those of a ULog"
_MODES = "`msggen command mode NAME` selects a mode, such as hold, and `msggen topic echo vehicle_status` shows it"
_MISSIONS = "missions go over MAVLink, with QGroundControl or MAVSDK; `msggen command` sends single commands"

_NO_QOS = "leave it out: there is no QoS between msggen and PX4, and every sample that arrives is taken"
_QOS = tuple(f"--qos-{name}" for name in ("profile", "depth", "history", "reliability", "durability", "liveliness"))

COMMANDS: Mapping[str, str] = {
    # ROS 2
    "param": _PARAMETERS,
    "node": "PX4 has no nodes: `msggen topic list` lists the topics, `msggen link list` the programs on a link",
    "service": "`msggen call` calls a service of the vehicle",
    "action": "PX4 has no actions: `msggen command` sends a command",
    "bag": "`msggen record`, `msggen play` and `msggen log info` do what ros2 bag does",
    "interface": "`msggen topic info TOPIC` shows the fields of a message, and `msggen docs` writes pages about all",
    "msg": "`msggen topic info TOPIC` shows the fields of a message, and `msggen docs` writes pages about all",
    "pkg": "`msggen sync` writes the package px4_msgs",
    "run": "`msggen relay` carries the topics to ROS 2; programs use msggen.live (docs/vehicle.md)",
    "launch": "`msggen relay` carries the topics to ROS 2; programs use msggen.live (docs/vehicle.md)",
    "daemon": "`msggen link list` lists the processes that own a link, `msggen link stop` stops one",
    "wtf": "`msggen doctor` finds out why nothing arrives",
    "replay": "`msggen play FILE` plays a recording",
    "rosbag": "`msggen record`, `msggen play` and `msggen log info` do what ros2 bag does",
    "sub": "`msggen topic echo TOPIC` prints the messages of a topic",
    # MAVSDK
    "connect": "a vehicle connects by itself: `msggen topic list` waits for it, and `msggen doctor` finds out why not",
    "telemetry": "`msggen top` shows all topics, and `msggen topic echo TOPIC` one",
    "subscribe": "`msggen topic echo TOPIC` prints the messages of a topic",
    "publish": "`msggen topic pub TOPIC VALUES` publishes",
    "arm": "`msggen command arm`",
    "disarm": "`msggen command disarm`",
    "takeoff": "`msggen command takeoff METRES`",
    "land": "`msggen command land`",
    "rtl": "`msggen command rtl`",
    "return_to_launch": "`msggen command rtl`",
    "hold": "`msggen command mode hold`",
    "goto": "`msggen command DO_REPOSITION`, or `flight.goto` in a program (docs/flight.md)",
    "offboard": "`flight.offboard()` in a program (docs/flight.md), or `msggen topic pub`",
    "mode": _MODES,
    "modes": _MODES,
    "mission": _MISSIONS,
    "geofence": _MISSIONS,
    "params": _PARAMETERS,
    # pyulog
    "ulog_info": "`msggen log info FILE`",
    "ulog_messages": "`msggen log show FILE --texts`",
    "ulog_params": "`msggen log show FILE --params`",
    "ulog2csv": "`msggen log convert FILE --format csv`",
    "ulog2rosbag": "`msggen log convert FILE --format rosbag2`",
    "ulog_migratedb": "`msggen log info FILE...` reads many logs",
    "ulog2kml": "`msggen log show FILE vehicle_gps_position` prints the positions; msggen writes no KML",
    "ulog_extract_gps_dump": "`msggen log convert FILE` writes the samples of all topics; there are no dumps of GPS",
    # MicroXRCEAgent
    "microxrceagent": _NO_AGENT,
    "agent": _NO_AGENT,
    "udp4": _NO_AGENT,
    "udp6": _NO_AGENT,
    "serial": "no agent is needed: `msggen topic list --link serial:///dev/ttyUSB0?baud=921600`",
    # PX4's shell, and others
    "listener": "`msggen topic echo TOPIC` prints what PX4's `listener` prints",
    "uorb": "`msggen top` shows the topics that cross the bridge, as `uorb top`",
    "shell": "PX4's shell goes over MAVLink, as in QGroundControl; `msggen completion` is for yours",
    "help": "`msggen --help` lists the commands, and `msggen COMMAND --help` the arguments of one",
    "version": "`msggen --version`",
    "generate": "`msggen build` generates a package",
    "diff": "`msggen breaking --against REF` compares definitions",
}
"""What to do about a word in place of a command or an action, in lower case."""

ARGUMENTS: Mapping[tuple[str, str], str] = {
    **{(f"topic {action}", option): _NO_QOS for action in ("echo", "hz", "bw", "delay", "pub") for option in _QOS},
    **dict.fromkeys(
        (("topic info", "-v"), ("topic info", "--verbose")), "the publishers and the QoS are shown without it"
    ),
    ("topic echo", "--timeout"): "use --for",
    ("topic hz", "-w"): "use --window, in seconds",
    ("topic plot", "-f"): "use --field",
    ("topic echo", "-f"): "use --field for a single value; messages are printed whole",
    ("topic echo", "--no-arr"): "use --field for a single value",
    ("topic echo", "--full-length"): "messages are printed whole without it",
    ("record", "-a"): "all topics are recorded without it",
    ("record", "--all"): "all topics are recorded without it",
    ("play", "--speed"): "use --rate",
    ("play", "--link"): "use --to",
    ("play", "--port"): "name it with --to udp://127.0.0.1:PORT",
    ("sim", "--port"): "name it in the address: msggen sim udp://127.0.0.1:PORT",
    ("sim", "--link"): "write the address alone: msggen sim udp://127.0.0.1:8888",
    ("sim", "--vehicles"): "use --count",
}
"""What to do about an argument, by command and word."""
