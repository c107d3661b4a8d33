"""The files of a recording, read as one: their topics, and the samples of topics between two log times."""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from msggen.recordings.decode.decoder import Decoder
from msggen.recordings.decode.left_out import LeftOut
from msggen.recordings.log.origin import firmware_of
from msggen.recordings.source.facts import NO_FACTS, Facts
from msggen.recordings.source.source import (
    FOREVER,
    Channel,
    Part,
    Problem,
    RecordingError,
    SchemaError,
    Source,
)
from msggen.recordings.topics.choice import check_times, listed
from msggen.recordings.topics.find import by_name, find, is_pattern, matching, topics_of
from msggen.recordings.topics.topic import Topic

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from msggen.recordings.decode.decoder import Decoded, Rows
    from msggen.recordings.definitions.lent import Lender, Lent
    from msggen.recordings.log.payloads import Encoder, Sample
    from msggen.recordings.topics.find import Key, Topics

    Times = NDArray[np.int64]
    Numbers = tuple[int, int]
    """The numbers of a file and of a channel in it."""


_PLAUSIBLE = 1e6
"""The largest time in s that may be behind a recording. Larger ones are in another unit, or since 1970."""

_TIMES = 16
"""The bytes of the two times of a sample."""
_OBJECT = 8
"""About how many times the size of its pointer an object has."""


class _Files:
    """The files, and whether they are closed.

    Topics refer to this and not to the reader, which has them: only the collector would free a log otherwise.
    """

    def __init__(self, sources: Sequence[Source], path: str) -> None:
        self._sources, self._path = sources, path
        self.is_closed = False

    def close(self) -> None:
        """Close the files. Can be repeated."""
        self.is_closed = True
        for source in self._sources:
            source.close()

    def check_open(self) -> None:
        """Raise RecordingError if the files are closed."""
        if self.is_closed:
            raise RecordingError(f"{self._path} is closed")

    def times(self, channels: Sequence[tuple[int, Channel]]) -> Times:
        """Return the log times of channels, in the order of the files."""
        self.check_open()
        return np.concatenate(
            [self._sources[number].times([channel.number])[channel.number] for number, channel in channels]
        )

    def ends(self, channels: Sequence[tuple[int, Channel]]) -> tuple[int, int] | None:
        """Return the first and the last log time of channels, None without samples."""
        self.check_open()
        found = [self._sources[number].ends(channel.number) for number, channel in channels]
        known = [each for each in found if each is not None]
        return (min(first for first, _ in known), max(last for _, last in known)) if known else None


class Reader:
    """The files of a recording, whose path is `path`."""

    def __init__(self, sources: Sequence[Source], lender: Lender | None, path: str) -> None:
        self.sources = sources
        self.path = path
        self._files = _Files(sources, path)
        self.left_out = LeftOut()
        self._lender = lender
        self._decoders: dict[Numbers, Decoder | SchemaError] = {}
        self._left_out_definitions: list[Problem] = []

    def close(self) -> None:
        """Close the files. Can be repeated."""
        self._files.close()

    @property
    def is_closed(self) -> bool:
        """Whether the files are closed."""
        return self._files.is_closed

    def check_open(self) -> None:
        """Raise RecordingError if the files are closed."""
        self._files.check_open()

    @cached_property
    def topics(self) -> tuple[Topic, ...]:
        """The topics, by name and instance."""
        channels = [
            (number, self._described(number, channel))
            for number, source in enumerate(self.sources)
            for channel in source.channels.values()
        ]
        release = firmware_of(self.information).release
        return topics_of(self._within_limits(channels), self._files.times, self._files.ends, release)

    @cached_property
    def by_name(self) -> Topics:
        """The topics by name and instance."""
        return by_name(self.topics)

    @cached_property
    def facts(self) -> Facts:
        """What only a ULog has, and an MCAP file made of one."""
        return next((source.facts for source in self.sources if source.facts is not NO_FACTS), NO_FACTS)

    @cached_property
    def information(self) -> Mapping[str, object]:
        """The information among the facts. The facts themselves may not have been read yet."""
        return self.sources[0].information if len(self.sources) == 1 else self.facts.information

    @cached_property
    def lent(self) -> Lent:
        """The definitions of channels that have none."""
        from msggen.recordings.definitions.lent import NOBODY, lend

        return lend(self.sources, self._lender or NOBODY, self.check_open)

    @property
    def notes(self) -> Sequence[str]:
        """Where the definitions of channels that have none are from, a line each."""
        channels = (channel for source in self.sources for channel in source.channels.values())
        lent = self.lent.notes if any(channel.lacks_definition for channel in channels) else ()
        return [*(note for source in self.sources for note in source.notes), *lent]

    @property
    def start(self) -> int:
        """The log time in ns at which the recording starts, 0 without samples."""
        start = self.facts.start
        if start is not None and 0 < start <= self.end:
            return start
        return min((source.span[0] for source in self.sources if source.span), default=0)

    @property
    def end(self) -> int:
        """The log time of the last sample in ns, 0 without samples."""
        return max((source.span[1] for source in self.sources if source.span), default=0)

    @property
    def problems(self) -> list[Problem]:
        """The problems found so far."""
        return [
            *(self._placed(source, problem) for source in self.sources for problem in source.problems),
            *self._left_out_definitions,
            *self.left_out.problems,
            *self._not_decoded(),
        ]

    # what users ask for

    def named(self, keys: Iterable[Key | Topic], is_taken: Callable[[Topic], bool] = lambda _: True) -> list[Topic]:
        """Return topics by names and patterns, each once. Patterns take only topics for which `is_taken` is true."""
        found: dict[Topic, None] = {}
        for key in [keys] if isinstance(keys, Topic) else listed(keys):
            own = filter(is_taken, matching(self.topics, key)) if is_pattern(key) else [find(self.by_name, key)]
            found.update(dict.fromkeys(own))
        return list(found)

    def limits(self, start: float | None, stop: float | None) -> tuple[int, int]:
        """Return log times in ns for times in s after the start. Raises RecordingError, and TypeError."""
        check_times(start, stop)
        duration = (self.end - self.start) / 1e9
        if start is not None and start > max(duration, _PLAUSIBLE):
            raise RecordingError(
                f"start: expected a time in s after the start of the recording, got {start:g}: "
                f"the recording lasts {duration:.3f} s"
            )
        # samples can be older than the start
        return self._log_time(start) if start else 0, FOREVER if stop is None else self._log_time(stop)

    def _log_time(self, seconds: float) -> int:
        return min(self.start + round(min(seconds * 1e9, FOREVER)), FOREVER)

    def size_of(self, topic: Topic) -> int:
        """Return about how many bytes the samples of a topic have as an array. A database is searched once for this."""
        dtype = self.decoder(topic).dtype
        size = dtype.itemsize * (_OBJECT if dtype.hasobject else 1) + _TIMES
        return topic.count * size

    # samples

    def payloads(self, topics: Iterable[Topic], low: int, high: int) -> Iterator[Sample]:
        """Return the samples of topics as CDR, by log time. Raises RecordingError for topics that have none."""
        from msggen.recordings.log.payloads import merged

        names: dict[int, dict[int, str]] = defaultdict(dict)
        encoders: dict[int, dict[int, Encoder]] = defaultdict(dict)
        for topic in topics:
            if not topic.has_cdr:
                channel = topic.channels[0][1]
                why = "and names that ROS 2 does not allow" if channel.is_of_uorb else "expected cdr"
                raise RecordingError(f"{topic.name} has samples in '{channel.encoding}', {why}")
            name = f"{topic.name}[{topic.instance}]" if topic.instance else topic.name
            for number, channel in topic.channels:
                names[number][channel.number] = name
                if not topic.is_cdr:
                    encoders[number][channel.number] = self._encoder(topic, channel)
        self.check_open()
        streams = []
        for number, own in sorted(names.items()):
            span = self.sources[number].span
            streams.append((span[0] if span else low, self._in_order(number, own, encoders[number], low, high)))
        return merged(streams)

    def _encoder(self, topic: Topic, channel: Channel) -> Encoder:
        """Return what makes CDR of the samples of a ULog, by their own definition."""
        from msggen.recordings.decode.layouts import encoded
        from msggen.recordings.decode.schemas import read_schema
        from msggen.recordings.log.payloads import Encoder

        decoder, schema = self.decoder(topic), read_schema(topic.ros_type, channel.definition)
        layout = channel.layout
        assert layout is not None  # noqa: S101 - a ULog has layouts

        def rows(part: Part) -> Decoded:
            with self.left_out.reading() as missing:
                return decoder.rows(part, missing[topic.name, topic.instance])

        return Encoder(rows, lambda found: encoded(found, layout, schema, schema))

    def undecoded(self, topics: Iterable[Topic], low: int, high: int) -> Iterator[tuple[Topic, Part]]:
        """Yield the samples of topics as they are in the files, in the order of the files."""
        wanted = {(number, channel.number): topic for topic in topics for number, channel in topic.channels}
        yield from ((wanted[number, part.channel], part) for number, part in self._parts(wanted, low, high))

    def rows(self, topics: Iterable[Topic], low: int, high: int) -> Iterator[tuple[Topic, Rows, Times, Times | None]]:
        """Yield rows as decoders give them, with log times and publish times. Raises RecordingError.

        Channels of the same name that cannot be decoded are reported.
        """
        wanted: dict[Numbers, tuple[Topic, Decoder]] = {}
        chosen = dict.fromkeys(topics)
        for topic in chosen:
            self.decoder(topic)
            for number, channel in topic.channels:
                decoder = self._tried(number, channel)
                if isinstance(decoder, Decoder):
                    wanted[number, channel.number] = topic, decoder
        names = {(topic.recorded_name, topic.instance) for topic, _ in wanted.values()}
        for topic in self.topics:
            if topic not in chosen and (topic.recorded_name, topic.instance) in names:
                self.can_decode(topic)
        with self.left_out.reading() as missing:
            for number, part in self._parts(wanted, low, high):
                topic, decoder = wanted[number, part.channel]
                rows, kept = decoder.rows(part, missing[topic.name, topic.instance])
                times, published = part.log_times, part.publish_times
                if kept is not None:
                    times, published = times[kept], None if published is None else published[kept]
                if len(rows):
                    yield topic, rows, times, published

    def decoder(self, topic: Topic) -> Decoder:
        """Return the decoder of a topic. Raises RecordingError."""
        found = self._tried(*topic.channels[0])
        if isinstance(found, SchemaError):
            raise RecordingError(f"{topic.name} cannot be decoded: {found}")
        return found

    def can_decode(self, topic: Topic) -> bool:
        """Whether a topic has samples that can be decoded."""
        return isinstance(self._tried(*topic.channels[0]), Decoder)

    # files

    def _parts(self, wanted: Iterable[Numbers], low: int, high: int) -> Iterator[tuple[int, Part]]:
        """Yield the samples of channels with the numbers of their files."""
        channels: dict[int, list[int]] = defaultdict(list)
        for number, channel in wanted:
            channels[number].append(channel)
        for number, own in sorted(channels.items()):
            yield from ((number, part) for part in self._parts_of(number, own, low, high))

    def _parts_of(self, number: int, channels: Collection[int], low: int, high: int) -> Iterator[Part]:
        """Yield the samples of channels of a file. The files can be closed while this goes on."""
        self.check_open()
        for part in self.sources[number].parts(channels, low, high):
            yield part
            self.check_open()

    def _in_order(
        self, number: int, names: Mapping[int, str], encoders: Mapping[int, Encoder], low: int, high: int
    ) -> Iterator[Sample]:
        """Yield the samples of channels of a file as CDR, whose topics are `names`, by log time."""
        self.check_open()
        times = self.sources[number].times(names.keys())
        from msggen.recordings.log.payloads import as_cdr, in_order

        parts = as_cdr(self._parts_of(number, names.keys(), low, high), encoders)
        yield from in_order(parts, times, names, low, high)

    def _count(self, number: int, channel: Channel) -> int:
        """Return the number of samples of a channel, 0 if it is not known and the files are closed."""
        if channel.sample_count is not None or self.is_closed:
            return channel.sample_count or 0
        return len(self._files.times([(number, channel)]))

    # definitions and problems

    def _described(self, number: int, channel: Channel) -> Channel:
        """Return a channel with a definition, if it has none and there is one elsewhere."""
        if not channel.lacks_definition:
            return channel
        key = number, channel.number
        definition = self.lent.definitions.get(key)
        if definition is None:
            return channel
        return channel._replace(definition=definition, is_lent=key not in self.lent.recorded)

    def _within_limits(self, channels: Sequence[tuple[int, Channel]]) -> Iterator[tuple[int, Channel]]:
        """Yield channels, without the definitions that have too many values together, which are reported."""
        if all(channel.layout is not None for _, channel in channels):
            yield from channels
            return
        from msggen.definitions.nesting import MAX_TOTAL
        from msggen.recordings.decode.schemas import nested_values

        values = 0
        is_kept: dict[tuple[str, str], bool] = {}
        for number, channel in channels:
            key = channel.ros_type, channel.definition
            if key not in is_kept:
                values += 0 if channel.layout is not None else nested_values(*key)
                is_kept[key] = values <= MAX_TOTAL
                if not is_kept[key]:
                    text = f"a definition is left out: all have more than {MAX_TOTAL} values together"
                    self._left_out_definitions.append(Problem(text, topic=channel.topic))
            yield number, channel if is_kept[key] else channel._replace(definition="")

    def _tried(self, number: int, channel: Channel) -> Decoder | SchemaError:
        """Return the decoder of a channel, or the reason why there is none."""
        key = number, channel.number
        if key not in self._decoders:
            try:
                self._decoders[key] = Decoder(channel)
            except SchemaError as error:
                self._decoders[key] = error
        return self._decoders[key]

    def _not_decoded(self) -> Iterator[Problem]:
        """Yield the channels that cannot be decoded, as far as that was tried."""
        counts: Counter[tuple[Topic, str]] = Counter()
        for topic in self.topics if self._decoders else ():
            for number, channel in topic.channels:
                error = self._decoders.get((number, channel.number))
                if isinstance(error, SchemaError):
                    counts[topic, str(error)] += self._count(number, channel)
        for (topic, reason), count in counts.items():
            text = f"{topic.name} is not decoded: {reason}"
            yield Problem(text, samples=count, topic=topic.name, instance=topic.instance)

    def _placed(self, source: Source, problem: Problem) -> Problem:
        """Return a problem with its times, and the name of its file if it has a place in one of several."""
        if problem.span is not None:
            first, last = ((time - self.start) / 1e9 for time in problem.span)
            problem = problem._replace(text=f"{problem.text}, from {first:.3f} to {last:.3f} s")
        if problem.offset is None or len(self.sources) == 1:
            return problem
        return problem._replace(text=f"{os.path.basename(source.path)}: {problem.text}")
