"""The interface between the formats of recordings and what reads them: channels, and where their samples are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.source.facts import NO_FACTS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from msggen.recordings.source.facts import Facts
    from msggen.recordings.source.memory import Octets, Places
    from msggen.recordings.source.rows import Layout

CDR, UORB = "cdr", "ulog"
"""The encodings of samples that are decoded: as in ROS 2, and as in uORB's struct."""
FOREVER = (1 << 63) - 1
"""The largest log time."""
SEPARATOR = "=" * 80
"""The line before the head of a nested message, in a definition of the format `ros2msg`."""


class SchemaError(ValueError):
    """A definition that cannot be read, is too large, or nests one that is missing or itself."""


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
    encoding: str = CDR
    """The encoding of the samples: CDR or UORB. Samples of other encodings are not decoded."""
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
    def is_cdr(self) -> bool:
        """Whether the samples are CDR, as in ROS 2."""
        return self.encoding == CDR

    @property
    def is_of_uorb(self) -> bool:
        """Whether the samples are in the order of uORB's struct, as in a ULog."""
        return self.encoding == UORB

    @property
    def is_decoded(self) -> bool:
        """Whether msggen decodes the encoding of the samples."""
        return self.is_cdr or self.is_of_uorb

    @property
    def lacks_definition(self) -> bool:
        """Whether its samples can only be decoded with a definition from elsewhere."""
        return not self.definition and self.layout is None and self.is_cdr

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


class Contents(NamedTuple):
    """The chunks of MCAP files, and what they have beside their samples."""

    chunks: int
    compressions: tuple[str, ...]
    """`zstd`, `lz4` and `none`, as far as chunks have them."""
    attachments: int
    metadata: int


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


class Source(ABC):
    """A file of a recording. Each module in `files/` that reads a format has a class of this kind."""

    kind: str
    """The format: `mcap`, `ulog`, `db3`."""
    notes: Sequence[str] = ()
    """Where definitions are from that were not recorded, if the file tells it, and what else a reader should know."""

    def __init__(self, path: str) -> None:
        self.path = path
        """The path for people: a file that was compressed is read elsewhere."""
        self.problems: list[Problem] = []
        """The problems of the file, each once. Reading appends those that it finds."""
        self.size = 0
        """The bytes of the file as it is on the disk, compressed or not."""
        self._closing: list[Callable[[], None]] = []

    @property
    @abstractmethod
    def channels(self) -> Mapping[int, Channel]:
        """The channels by their numbers."""

    @property
    @abstractmethod
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in ns, or None without samples."""

    @abstractmethod
    def parts(self, channels: Collection[int], start: int = 0, stop: int = FOREVER) -> Iterator[Part]:
        """Yield the samples of `channels` whose log times are from `start` up to `stop`, `stop` excluded.

        Parts of a channel are in the order of the file. Only the bytes that they need are read. Raises OSError.
        """

    @abstractmethod
    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """Return the log times of all samples of `channels`, in the order of the file."""

    def ends(self, channel: int) -> tuple[int, int] | None:
        """Return the first and the last log time of a channel, None without samples."""
        times = self.times([channel])[channel]
        return (int(times.min()), int(times.max())) if len(times) else None

    @property
    def contents(self) -> Contents | None:
        """What an MCAP file is made of, None for other formats."""
        return None

    @property
    def facts(self) -> Facts:
        """What the file tells beside its topics. Reading it can take time."""
        return NO_FACTS

    @property
    def information(self) -> Mapping[str, object]:
        """The information among the facts."""
        return self.facts.information

    @property
    def message_count(self) -> int | None:
        """The number of messages, None if only reading all of them would show it."""
        counts = [channel.sample_count for channel in self.channels.values()]
        return None if None in counts else sum(count or 0 for count in counts)

    @property
    def missing_checksums(self) -> int | None:
        """How many chunks have no checksum, None if the format has no checksums."""
        return None

    def verify(self) -> Checksums:
        """Add the chunks that differ from their checksums to `problems`, if the format has some. Reads all of them."""
        return NO_CHECKSUMS

    def attached(self) -> Iterator[Attached]:
        """Yield what an MCAP file has beside its channels. What cannot be read is added to `problems`."""
        return iter(())

    def close_with(self, close: Callable[[], None]) -> None:
        """Let `close` call a function, too, behind those that were added before. It can be called several times."""
        self._closing.append(close)

    def close(self) -> None:
        """Close the file. Can be repeated."""
        for close in self._closing:
            close()
