"""The interface between the formats of recordings and what reads them: channels, and where their samples are."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from msggen.recordings.source.memory import Octets, Places
    from msggen.recordings.source.rows import Layout

FOREVER = (1 << 63) - 1
"""The largest log time."""
SEPARATOR = "=" * 80
"""The line before the head of a nested message, in a definition of the format `ros2msg`."""


class RecordingError(ValueError):
    """A file that cannot be read as a recording, or a topic that it does not have. The message is one line."""


class UnknownFieldError(RecordingError):
    """A field that no topic of those that were asked for has."""


class Problem(NamedTuple):
    """Data in a recording that was not read, or an inconsistency."""

    text: str
    """One line, lower case."""
    offset: int | None = None
    """The offset in the file at which it begins."""
    size: int = 0
    """How many bytes of the file were left out."""
    samples: int = 0
    """How many samples were left out, as far as that can be counted."""
    topic: str = ""
    instance: int = 0
    """The number of the instance of `topic`."""
    path: str = ""
    """The recording, if there are several."""
    span: tuple[int, int] | None = None
    """The log times in ns from which to which samples are damaged, None if that is not known."""


class RawSchema(NamedTuple):
    """A schema as an MCAP file has it."""

    name: str
    encoding: str
    """The format: `protobuf`, `jsonschema`, `ros2idl`."""
    data: bytes


class Channel(NamedTuple):
    """The samples of a topic with one definition, in one file."""

    number: int
    topic: str
    """The name in the file: `/fmu/out/vehicle_status_v4`, or `vehicle_status` in a ULog."""
    ros_type: str
    """The type in ROS 2: `px4_msgs/msg/VehicleStatus`."""
    definition: str
    """The definition in the format `ros2msg`, with all that it nests. "" if the recording has none."""
    encoding: str = "cdr"
    """The encoding of the samples: `cdr`, or `ulog`. Samples of other encodings are not decoded."""
    instance: int = 0
    """The number of the instance of a uORB topic."""
    sample_count: int | None = None
    """How many samples it has, None if the file does not tell."""
    type_hash: str = ""
    """The type hash of ROS 2 (RIHS01), "" if the file does not tell it."""
    layout: Layout | None = None
    """The layout of the samples if it does not follow from the definition, as in a ULog."""
    qos: str = ""
    """The quality of service of the writers as rosbag2 stores it, in YAML. "" if the file does not tell it."""
    schema: RawSchema | None = None
    """The schema if it is in another format than `ros2msg`."""
    metadata: tuple[tuple[str, str], ...] = ()
    """What the file tells of the channel beside these: keys and values."""
    is_lent: bool = False
    """Whether `definition` was not recorded, but taken from elsewhere."""

    @property
    def definition_format(self) -> str:
        """The format of the recorded definition if that is not `ros2msg`, and so `definition` is ""."""
        return self.schema.encoding if self.schema else ""

    @property
    def content(self) -> tuple[object, ...]:
        """The definition and the encoding of the samples."""
        return self.ros_type, self.definition, self.schema, self.encoding


class Part(NamedTuple):
    """Samples of a channel in one buffer, which is valid until the next part is read.

    All other arrays have an element for each sample.
    """

    channel: int
    buffer: Octets
    starts: Places
    """The offset of each payload in the buffer; of CDR with its encapsulation header."""
    sizes: Places
    """The size of each payload in bytes. A payload does not end behind the buffer."""
    log_times: NDArray[np.int64]
    """When the samples were recorded, in ns since 1970; in a ULog, since the start of the vehicle."""
    publish_times: NDArray[np.int64] | None = None
    """The times at which they were published, None if the format does not have them."""


class Verification(NamedTuple):
    """What becomes of data with checksums."""

    is_on: bool = True
    """Whether checksums are compared when data is read."""
    keeps_damaged: bool = False
    """Whether data that does not match is read all the same. It is reported in any case."""


VERIFIED = Verification()


class Checksums(NamedTuple):
    """The chunks of a recording, and messages that are in no chunk: each stretch of them counts as one."""

    compared: int
    """How many have a checksum, and were compared with it."""
    missing: int
    """How many have none."""


NO_CHECKSUMS = Checksums(0, 0)


class Attached(NamedTuple):
    """An attachment or a metadata record of an MCAP file (https://mcap.dev/spec)."""

    name: str
    content: memoryview
    """The content of the record, valid until the file is closed."""
    is_attachment: bool
    log_time: int = 0
    create_time: int = 0
    """In ns since 1970. Those of an attachment."""
    media_type: str = ""
    size: int = 0
    """The bytes of the attached data."""


class Source(Protocol):
    """A file, or a folder of files, as one of the modules in `files/` reads it."""

    path: str
    kind: str
    """The format: `mcap`, `ulog`, `db3` or `rosbag2`."""
    problems: list[Problem]
    """The problems of the file, each once. Reading appends those that it finds."""
    notes: Sequence[str]
    """Where definitions are from that were not recorded, a line each, if the file tells it."""

    @property
    def channels(self) -> Mapping[int, Channel]:
        """The channels by their numbers."""

    @property
    def facts(self) -> Facts:
        """What a ULog has beside its topics. Reading all takes time."""

    @property
    def information(self) -> Mapping[str, object]:
        """The information among the facts."""

    @property
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in ns, or None without samples."""

    def parts(self, channels: Collection[int], start: int = 0, stop: int = FOREVER) -> Iterator[Part]:
        """Yield the samples of `channels` whose log times are from `start` up to `stop`, `stop` excluded.

        Parts of a channel are in the order of the file. Only the bytes that they need are read. Raises OSError.
        """

    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """Return the log times of all samples of `channels`, in the order of the file."""

    @property
    def missing_checksums(self) -> int | None:
        """How many chunks have no checksum, None if the format has no checksums."""

    def verify(self) -> Checksums:
        """Add the chunks that differ from their checksums to `problems`, if the format has some. Reads all of them."""

    def attached(self) -> Iterator[Attached]:
        """Yield what an MCAP file has beside its channels. What cannot be read is added to `problems`."""

    def close(self) -> None:
        """Close the file. Can be repeated."""


LEVELS = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
"""The levels of texts, as in Linux (https://docs.px4.io/main/en/dev_log/ulog_file_format.html)."""


class Text(NamedTuple):
    """A line of a vehicle's log."""

    time: int
    """In ns, as log times are."""
    level: str
    """`emergency`, `alert`, `critical`, `error`, `warning`, `notice`, `info`, `debug`, or `unknown`."""
    text: str
    tag: int | None = None
    is_event: bool = False
    """Whether it is an event, or a line that the vehicle also sent as one."""


class Event(NamedTuple):
    """An event of PX4: what happened, in words. Without metadata, it has no name, group, description and arguments."""

    time: int
    """In ns, as log times are."""
    number: int
    """The number of its definition in the metadata (`id` in Event.msg)."""
    sequence: int
    """The number of the event: the vehicle counts up, so that a gap is a lost event."""
    level: str
    """The level in the vehicle's log: as that of a text, or `protocol` or `disabled`, which are not for users."""
    external_level: str
    """The level for ground stations and other programs."""
    text: str
    """What it says, `event 0x0112abcd` without metadata."""
    name: str = ""
    """The name in the metadata: `commander_armed_by`."""
    group: str = ""
    """`default` for what a user reads, `arming_check`, `health`, `calibration`."""
    description: str = ""
    """More about it, such as what to do."""
    arguments: Mapping[str, int | float] = MappingProxyType({})

    @property
    def is_text(self) -> bool:
        """Whether it is among the texts of the log: those of other groups are reports for ground stations."""
        return self.level in LEVELS and self.group in ("", "default")


class Dropout(NamedTuple):
    """A period in which the logger lost samples."""

    time: int
    """The time in ns of the last sample before it, 0 if there is none."""
    duration: int
    """In ns."""


def _is_same(value: float, other: float) -> bool:
    """Whether two values of a parameter are the same. NaN is the same as NaN."""
    return value == other or (value != value and other != other)  # noqa: PLR0124 - true for NaN alone


class Facts(NamedTuple):
    """What only a ULog has beside its topics, and an MCAP file that was made of one."""

    parameters: Mapping[str, int | float]
    """The parameters at the start of the log."""
    changed_parameters: Sequence[tuple[int, str, int | float]]
    """Times in ns, names and values of parameters that changed later."""
    default_parameters: Mapping[str, int | float]
    """The defaults of the firmware that differ from the parameters at the start."""
    information: Mapping[str, object]
    """Such as `sys_name`, `ver_sw`: text, numbers, tuples, bytes; what has several parts is a list of lists of them."""
    texts: Sequence[Text]
    dropouts: Sequence[Dropout]
    start: int | None = None
    """The log time in ns at which the recording starts: some samples are older. None if it does not tell."""
    boot: int | None = None
    """When the vehicle started, in ns since 1970, if that was added to the times in the ULog."""
    airframe_defaults: Mapping[str, int | float] = MappingProxyType({})
    """The defaults of the airframe that differ from the parameters at the start."""

    @property
    def has_defaults(self) -> bool:
        """Whether the log has defaults. Older firmware does not write them."""
        return bool(self.default_parameters or self.airframe_defaults)

    @property
    def tuned(self) -> Mapping[str, int | float]:
        """The defaults of the airframe, of the parameters that had other values at the start."""
        return self._others(self.airframe_defaults)

    @property
    def configured(self) -> Mapping[str, int | float]:
        """The defaults of the firmware, of the parameters that had other values at the start."""
        return self._others(self.default_parameters)

    def _others(self, defaults: Mapping[str, int | float]) -> Mapping[str, int | float]:
        own = self.parameters
        return {name: value for name, value in defaults.items() if name in own and not _is_same(own[name], value)}


NO_FACTS = Facts({}, (), {}, {}, (), ())
