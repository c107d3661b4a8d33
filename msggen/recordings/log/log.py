"""A recording in any format: its topics, and their samples as arrays."""

from __future__ import annotations

from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from msggen.base.diagnostics import counted
from msggen.recordings.columns.arrays import check_fields
from msggen.recordings.columns.collector import Collector
from msggen.recordings.columns.samples import Samples
from msggen.recordings.log.origin import Firmware, firmware_of, gps_offset_of, utc_offset_of, vehicle_of
from msggen.recordings.log.reader import Reader
from msggen.recordings.source.facts import NO_FACTS, Dropout, Event, Facts, Text
from msggen.recordings.source.source import Attached, Checksums, Contents, Part, Problem, RecordingError, Source
from msggen.recordings.topics.choice import checked_time, listed
from msggen.recordings.topics.find import Key, find
from msggen.recordings.topics.topic import Topic

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
    from types import ModuleType
    from typing import Literal, TypeVar

    import pandas as pd
    import polars as pl
    import pyarrow as pa
    from numpy.typing import NDArray
    from typing_extensions import Self

    from msggen.recordings.decode.decoder import Rows
    from msggen.recordings.definitions.comparison import Compared
    from msggen.recordings.definitions.lent import Lender
    from msggen.recordings.definitions.release import Release
    from msggen.recordings.log.ahead import Ahead
    from msggen.recordings.log.align import Aligned, Direction
    from msggen.recordings.log.payloads import Sample

    MessageT = TypeVar("MessageT")

__all__ = ["Key", "Log"]


class Log:
    """A recording. `recordings.open` makes it; a `with` statement closes it.

    `log["vehicle_odometry"]` and `log["sensor_gps", 1]` are structured arrays of all samples of a topic. Topics have
    all their names: `/fmu/out/vehicle_status_v4`, `vehicle_status`, `VehicleStatus`.
    """

    def __init__(self, sources: Sequence[Source], lender: Lender | None = None, path: str = "") -> None:
        self._reader = Reader(sources, lender, path or sources[0].path)

    def __enter__(self) -> Self:
        """Return the log."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the files."""
        self.close()

    def close(self) -> None:
        """Close the files. Arrays that were read stay valid, and reading further raises RecordingError."""
        self._reader.close()
        if "_ahead" in self.__dict__:
            self._ahead.clear()

    # what there is

    @property
    def path(self) -> str:
        """The path of the recording, or the name of the file object."""
        return self._reader.path

    @property
    def size(self) -> int:
        """The bytes of the files with samples, compressed if they are."""
        return sum(source.size for source in self._reader.sources)

    @property
    def kind(self) -> str:
        """The format: `mcap`, `ulog`, `db3`."""
        return self._reader.sources[0].kind

    @property
    def start(self) -> int:
        """The log time in ns at which the recording starts, 0 without samples.

        That is its first sample. A ULog, and an MCAP file made of one, have the time in the ULog's header: some samples
        are older, as they were published before, some with the time 0.
        """
        return self._reader.start

    @property
    def end(self) -> int:
        """The log time of the last sample in ns, 0 without samples."""
        return self._reader.end

    @property
    def duration(self) -> float:
        """The time from the start to the last sample in s."""
        return (self.end - self.start) / 1e9

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics, by name and instance. A topic whose definition changes is several topics: `/a#1` and `/a#2`."""
        return self._reader.topics

    @property
    def facts(self) -> Facts:
        """What only a ULog has, and an MCAP file made of one: parameters, information, texts and dropouts."""
        return self._reader.facts

    @property
    def has_facts(self) -> bool:
        """Whether the recording is a ULog, or an MCAP file made of one."""
        return self.facts is not NO_FACTS

    @property
    def parameters(self) -> Mapping[str, int | float]:
        """The parameters of the vehicle at the start of a ULog. `facts` has those that changed, and the defaults."""
        return self.facts.parameters

    @property
    def information(self) -> Mapping[str, object]:
        """Information about the vehicle in a ULog, such as `sys_name` and `ver_sw`."""
        return self._reader.information

    @cached_property
    def texts(self) -> Sequence[Text]:
        """The lines of the vehicle's log in a ULog, and its events that users read. `facts` has the lines alone.

        The first use reads the events, and so comes before the log is closed.
        """
        from msggen.recordings.log.events import with_events

        return with_events(self.facts.texts, self.events)

    @property
    def events(self) -> Sequence[Event]:
        """The events of the vehicle by log time, decoded with the metadata in a ULog, or as `/events` has them."""
        return self._decoded_events[0]

    @property
    def event_notes(self) -> Sequence[str]:
        """Why events are not decoded, a line each."""
        return self._decoded_events[1]

    @cached_property
    def _decoded_events(self) -> tuple[Sequence[Event], Sequence[str]]:
        """The events, and why some are not decoded."""
        from msggen.recordings.log.decoded_events import is_decoded
        from msggen.recordings.log.events import has_events, read_events

        topics = [topic for topic in self.topics if self._reader.can_decode(topic)]
        return read_events(filter(has_events, topics), filter(is_decoded, topics), self.samples, self.information)

    @property
    def dropouts(self) -> Sequence[Dropout]:
        """The periods in which the logger of a ULog lost samples."""
        return self.facts.dropouts

    @cached_property
    def utc_offset(self) -> int | None:
        """The offset in ns from log time to UTC: 0 if log times are already UTC, None if unknown."""
        return utc_offset_of(self.start, self.kind, self.information, lambda: gps_offset_of(self.topics, self.samples))

    @property
    def vehicle(self) -> str:
        """The unique number of the vehicle's board in a ULog, "" if it is not known."""
        return vehicle_of(self.information)

    @property
    def firmware(self) -> Firmware:
        """The release and the commit of the firmware that wrote a ULog, each "" if it is not known."""
        return firmware_of(self.information)

    @property
    def problems(self) -> list[Problem]:
        """The problems found so far. Reading samples can find more."""
        return self._reader.problems

    def release(self) -> Release:
        """Return the embedded release of PX4 that the recording is from, by its definitions and what a ULog tells."""
        from msggen.recordings.definitions.release import release_of

        return release_of(self.topics, self.firmware.release)

    @property
    def notes(self) -> list[str]:
        """Where the definitions of topics that have none in the recording are from, and which topics of a ULog have
        samples without a time, a line each.
        """
        return [*self._reader.notes]

    def topic(self, key: Key | Topic, instance: int | None = None) -> Topic:
        """Return the topic with a name, in any spelling. Raises RecordingError if there is none, or several.

        `sensor_gps[1]` is the instance 1 of `sensor_gps`, and so is `sensor_gps_1` if no topic has this name.
        """
        return find(self._reader.by_name, key, instance)

    def __repr__(self) -> str:
        """Return path, format, duration and number of topics."""
        topics = {(each.topic, each.instance) for source in self._reader.sources for each in source.channels.values()}
        return f"<Log {self.path!r}: {self.kind}, {self.duration:.3f} s, {counted(len(topics), 'topic')}>"

    # samples

    def keys(self) -> list[Key]:
        """Return the topics as keys: a name, or a name and the number of an instance that is not 0."""
        self._ahead.expect_loop()
        return [topic.key for topic in self.topics]

    def __iter__(self) -> Iterator[Key]:
        """Iterate over the keys."""
        return iter(self.keys())

    def __len__(self) -> int:
        """Return the number of topics."""
        return len(self.topics)

    def __getitem__(self, key: Key) -> Rows:
        """Return all samples of a topic as a structured array. Raises RecordingError."""
        return self.samples(key).array

    def __contains__(self, key: object) -> bool:
        """Whether there is a topic with this name."""
        try:
            find(self._reader.by_name, key)  # type: ignore[arg-type]
        except (RecordingError, TypeError):
            return False
        return True

    def samples(
        self,
        key: Key | Topic,
        *,
        instance: int | None = None,
        start: float | None = None,
        stop: float | None = None,
        fields: Collection[str] | None = None,
    ) -> Samples:
        """Return the samples of a topic, from `start` up to `stop`, in s after the start of the recording.

        `start=0` includes the samples that are older than that. `instance=1` is the second instance, as in the key
        `("sensor_gps", 1)`. `fields` are those that `columns`, `table` and `frame` give, in this order. Raises
        RecordingError, also for samples that cannot be decoded at all: in another encoding, or without a definition.
        """
        topic = self.topic(key, instance)
        if fields is not None:
            check_fields(self.dtype(topic), listed(fields))
        found = self._ahead.take(topic) if start is None and stop is None and not self._reader.is_closed else None
        if found is None:
            found = self.load([topic], start=start, stop=stop)[topic.key]
        return found.choose(fields)

    def columns(  # noqa: PLR0913 - all but the key have defaults
        self,
        key: Key | Topic,
        *,
        instance: int | None = None,
        start: float | None = None,
        stop: float | None = None,
        fields: Collection[str] | None = None,
        times: bool = False,
        sql_names: bool = False,
    ) -> dict[str, NDArray[Any]]:
        """Return the columns of a topic by name, as `samples` and `Samples.columns` do."""
        found = self.samples(key, instance=instance, start=start, stop=stop, fields=fields)
        return found.columns(times=times, sql_names=sql_names)

    def table(  # noqa: PLR0913
        self,
        key: Key | Topic,
        *,
        instance: int | None = None,
        start: float | None = None,
        stop: float | None = None,
        fields: Collection[str] | None = None,
        times: bool = False,
        sql_names: bool = False,
    ) -> pa.Table:
        """Return a topic as a table of Arrow, as `samples` and `Samples.table` do."""
        found = self.samples(key, instance=instance, start=start, stop=stop, fields=fields)
        return found.table(times=times, sql_names=sql_names)

    @overload
    def frame(
        self,
        key: Key | Topic,
        library: Literal["pandas"] = ...,
        *,
        instance: int | None = ...,
        start: float | None = ...,
        stop: float | None = ...,
        fields: Collection[str] | None = ...,
        sql_names: bool = ...,
    ) -> pd.DataFrame: ...

    @overload
    def frame(
        self,
        key: Key | Topic,
        library: Literal["polars"],
        *,
        instance: int | None = ...,
        start: float | None = ...,
        stop: float | None = ...,
        fields: Collection[str] | None = ...,
        sql_names: bool = ...,
    ) -> pl.DataFrame: ...

    def frame(  # noqa: PLR0913
        self,
        key: Key | Topic,
        library: Literal["pandas", "polars"] = "pandas",
        *,
        instance: int | None = None,
        start: float | None = None,
        stop: float | None = None,
        fields: Collection[str] | None = None,
        sql_names: bool = False,
    ) -> Any:
        """Return a topic as a data frame of `pandas` or `polars` with log times, as `Samples.frame` does."""
        found = self.samples(key, instance=instance, start=start, stop=stop, fields=fields)
        return found.frame(library, sql_names=sql_names)

    def load(
        self,
        topics: Iterable[Key | Topic] | None = None,
        *,
        start: float | None = None,
        stop: float | None = None,
    ) -> dict[Key, Samples]:
        """Return the samples of several topics by key, all read in one pass. Default: all topics.

        Names can be patterns such as `sensor_*`. Topics that cannot be decoded are left out, and reported in
        `problems`, unless they are named.
        """
        chosen = self.chosen(topics)
        limited = start is not None or stop is not None
        collected = {
            topic.key: Collector(topic, self._reader.decoder(topic).dtype, 0 if limited else topic.known_count or 0)
            for topic in chosen
        }
        for topic, rows, times, published in self._reader.rows(chosen, *self._reader.limits(start, stop)):
            collected[topic.key].add(rows, times, published)
        return {key: collector.samples() for key, collector in collected.items()}

    def batches(
        self,
        topics: Iterable[Key | Topic] | None = None,
        *,
        start: float | None = None,
        stop: float | None = None,
    ) -> Iterator[Samples]:
        """Yield the samples of several topics piece by piece, in the order of the file, for files beyond the memory."""
        for topic, rows, times, published in self._reader.rows(self.chosen(topics), *self._reader.limits(start, stop)):
            own = np.array(times), None if published is None else np.array(published)  # they can be the file's
            yield Samples(topic.without_log, rows.view(self.dtype(topic)), *own)

    def tables(
        self,
        topics: Iterable[Key | Topic] | None = None,
        *,
        start: float | None = None,
        stop: float | None = None,
        times: bool = False,
        sql_names: bool = False,
    ) -> Iterator[tuple[Key, pa.Table]]:
        """Yield the keys of several topics with their tables, as `table` returns them. Default: all topics.

        A pass over the recording reads topics with 256 MB of samples together, or a larger topic. They are dropped once
        their table is made.
        """
        for key, samples in self._in_passes(topics, start, stop):
            yield key, samples.table(times=times, sql_names=sql_names)

    def frames(
        self,
        topics: Iterable[Key | Topic] | None = None,
        library: Literal["pandas", "polars"] = "pandas",
        *,
        start: float | None = None,
        stop: float | None = None,
        sql_names: bool = False,
    ) -> Iterator[tuple[Key, Any]]:
        """Yield the keys of several topics with their data frames, as `frame` returns them, read as `tables` does."""
        for key, samples in self._in_passes(topics, start, stop):
            yield key, samples.frame(library, sql_names=sql_names)

    def payloads(
        self,
        topics: Iterable[Key | Topic] | None = None,
        *,
        start: float | None = None,
        stop: float | None = None,
    ) -> Iterator[Sample]:
        """Yield the samples of several topics as CDR, by log time. Default: all topics in CDR.

        Topics without a definition are among them. Those of a ULog are encoded in little-endian XCDR1 by their own
        definition, `Topic.definition`, whose fields are in the order of uORB's struct. Samples are read piece by piece;
        of several files, each is begun when its first sample is reached. Raises RecordingError for topics in another
        encoding, for those of a ULog with names that ROS 2 does not allow, and for a recording that has only such.
        """
        chosen = [topic for topic in self.topics if topic.has_cdr] if topics is None else self._reader.named(topics)
        return self._reader.payloads(chosen or self.topics, *self._reader.limits(start, stop))

    def verify(self) -> Checksums:
        """Compare MCAP files with their checksums, and return how many chunks have one.

        These are the checksums of chunks, attachments, data section and summary. `problems` has what differs. Reading
        compares only what it reads.
        """
        self._reader.check_open()
        found = [source.verify() for source in self._reader.sources]
        return Checksums(sum(each.compared for each in found), sum(each.missing for each in found))

    @property
    def contents(self) -> Contents | None:
        """The numbers of chunks, attachments and metadata records in MCAP files, None for other formats."""
        found = [each for each in (source.contents for source in self._reader.sources) if each is not None]
        if not found:
            return None
        return Contents(
            sum(each.chunks for each in found),
            tuple(sorted({kind for each in found for kind in each.compressions})),
            sum(each.attachments for each in found),
            sum(each.metadata for each in found),
        )

    @property
    def missing_checksums(self) -> int | None:
        """How many chunks of MCAP files have no checksum, None for other formats, which have no checksums.

        rosbag2 writes none by default. Values that were changed by damage cannot be found without them.
        """
        found = [each for each in (source.missing_checksums for source in self._reader.sources) if each is not None]
        return sum(found) if found else None

    def attached(self) -> Iterator[Attached]:
        """Yield the attachments and the metadata records of MCAP files."""
        for source in self._reader.sources:
            self._reader.check_open()
            yield from source.attached()

    def align(  # noqa: PLR0913 - most have defaults
        self,
        first: Key | Topic,
        *others: Key | Topic,
        tolerance: float,
        by: str | None = None,
        direction: Direction = "latest",
        start: float | None = None,
        stop: float | None = None,
    ) -> Aligned:
        """Return each sample of the first topic with the sample that each other topic had at its time.

        That is the `latest` one up to this time, or the `nearest` one; not more than `tolerance` s away. Samples of the
        first topic for which a topic has no such sample are left out and counted. Times are those of the field `by`,
        in us, or `log_time` or `publish_time`. Default: `timestamp` if all topics have it, and all since boot or all
        since 1970, otherwise `log_time`. All topics are read into memory; `start` and `stop` limit the samples of the
        first one. Raises RecordingError.
        """
        from msggen.recordings.log.align import align, rows_of

        chosen = [self.topic(each) for each in (first, *others)]
        low, high = self._reader.limits(start, stop)
        checked_time("tolerance", tolerance)
        earlier = later = None
        if by == "log_time" and tolerance < inf:  # by other times, partners can have any log time
            earlier = None if start is None else max(start - tolerance, 0.0)
            later = None if stop is None else stop + tolerance
        loaded = self.load(chosen, start=earlier, stop=later)
        samples = [loaded[topic.key] for topic in chosen]
        samples[0] = rows_of(samples[0], (samples[0].log_times >= low) & (samples[0].log_times < high))
        return align(samples, tolerance, by, direction)

    @overload
    def messages(
        self,
        cls: type[MessageT],
        *,
        topic: Key | Topic | None = ...,
        instance: int | None = ...,
        start: float | None = ...,
        stop: float | None = ...,
        convert: bool = ...,
        times: Literal[False] = ...,
    ) -> Iterator[MessageT]: ...

    @overload
    def messages(
        self,
        cls: type[MessageT],
        *,
        topic: Key | Topic | None = ...,
        instance: int | None = ...,
        start: float | None = ...,
        stop: float | None = ...,
        convert: bool = ...,
        times: Literal[True],
    ) -> Iterator[tuple[int, MessageT]]: ...

    def messages(  # noqa: PLR0913 - all but the class have defaults
        self,
        cls: type[MessageT],
        *,
        topic: Key | Topic | None = None,
        instance: int | None = None,
        start: float | None = None,
        stop: float | None = None,
        convert: bool = False,
        times: bool = False,
    ) -> Iterator[MessageT] | Iterator[tuple[int, MessageT]]:
        """Yield the samples of a topic as messages of a generated class, in the order of their log times.

        The topic is that of the class, unless it is named. The class must have the definition of the recording; with
        `convert`, it can be another version of it, in a package that was built with archived versions. With `times`,
        yield pairs of log time in ns and message. Raises RecordingError, which tells the difference and what to do, and
        TypeError for another class. Samples that cannot be decoded are left out, and reported in `problems`.
        """
        from msggen.recordings.log.messages import messages_of, topic_of

        chosen = topic_of(self.topics, cls, instance) if topic is None else self.topic(topic, instance)
        found = messages_of(self._reader, chosen, cls, self._reader.limits(start, stop), is_converted=convert)
        return found if times else (message for _, message in found)

    def compare(self, package: ModuleType) -> tuple[Compared, ...]:
        """Compare the definition of each topic with that of its class in a generated package."""
        from msggen.recordings.definitions.comparison import compare

        return compare(self.topics, self.path, package)

    def undecoded(
        self,
        topics: Iterable[Key | Topic] | None = None,
        *,
        start: float | None = None,
        stop: float | None = None,
    ) -> Iterator[tuple[Topic, Part]]:
        """Yield the samples of several topics as they are in the files, in the order of the file. Default: all topics.

        A part is valid until the next one.
        """
        chosen = self.topics if topics is None else self._reader.named(topics)
        yield from self._reader.undecoded(chosen, *self._reader.limits(start, stop))

    def chosen(self, topics: Iterable[Key | Topic] | None) -> list[Topic]:
        """Return the topics that `topics` name, by default those that can be decoded. Raises RecordingError.

        Patterns take topics that can be decoded.
        """
        if topics is not None:
            return self._reader.named(topics, self._reader.can_decode)
        return [topic for topic in self.topics if self._reader.can_decode(topic)]

    def dtype(self, key: Key | Topic) -> np.dtype[Any]:
        """Return the dtype of the samples of a topic. Raises RecordingError."""
        return self._reader.decoder(self.topic(key)).dtype

    @cached_property
    def _ahead(self) -> Ahead:
        """What a loop over the topics will ask for next."""
        from msggen.recordings.log.ahead import Ahead

        topics = [topic for topic in self.topics if topic.known_count != 0]
        return Ahead(topics, self._reader.can_decode, self._reader.size_of, self.load)

    def _in_passes(
        self, topics: Iterable[Key | Topic] | None, start: float | None, stop: float | None
    ) -> Iterator[tuple[Key, Samples]]:
        """Yield keys and samples of topics, read in as few passes as their sizes allow."""
        from msggen.recordings.log.ahead import passes_over

        for group in passes_over(self.chosen(topics), self._reader.size_of):
            loaded = self.load(group, start=start, stop=stop)
            for key in list(loaded):
                yield key, loaded.pop(key)
