"""Tests of a recording in Foxglove, with its playback controls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, Writer

from msggen.recordings.log import opening
from msggen.show.view.recording import (
    Controls,
    RecordingView,
    UnviewableRecordingError,
    channels_of,
    package_for,
)
from msggen.show.view.server import Server
from support.foxglove_client import FoxgloveClient

START = 1_790_000_000_000_000_000
PLAY, PAUSE = 0, 1


def write(path: Path, package: Any, count: int = 50, *, is_finished: bool = True) -> list[tuple[str, int, bytes]]:
    """Write a recording of one sample a second, and return them."""
    samples = []
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, chunk_size=1000)
        writer.start("ros2")
        channels = {}
        for cls in (package.VehicleStatus, package.VehicleOdometry):
            info = cls.__msg__
            schema = writer.register_schema(info.ros_type, "ros2msg", info.definition.encode())
            channels[cls] = writer.register_channel(f"/fmu/out/{info.name}", "cdr", schema), f"/fmu/out/{info.name}"
        for number in range(count):
            cls = (package.VehicleStatus, package.VehicleOdometry)[number % 2]
            frame = {} if number % 2 == 0 else {"pose_frame": 1, "q": (1.0, 0.0, 0.0, 0.0)}
            channel, topic = channels[cls]
            payload, time = cls(timestamp=number, **frame).encode(), START + number * 1_000_000_000
            writer.add_message(channel, time, payload, time)
            samples.append((topic, time, payload))
        if is_finished:
            writer.finish()
    return samples


@pytest.mark.parametrize("is_finished", [True, False])
def test_a_recording_is_played_and_its_controls_work(tmp_path: Path, px4_types: Any, is_finished: bool) -> None:  # noqa: FBT001
    path = tmp_path / "flight.mcap"
    samples = write(path, px4_types, is_finished=is_finished)
    controls = Controls()
    recording = opening.open(path)
    assert package_for(recording, [px4_types]) is px4_types
    with (
        Server("test", "127.0.0.1", 0, (recording.start, recording.end), controls) as server,
        FoxgloveClient(server.port) as client,
    ):
        view = RecordingView(server, recording, controls, px4_types)

        def play() -> bool:
            view.advance()
            server.draw_model(START)  # so that the client gets something to receive
            return len(set(client.samples) & set(samples)) >= expected

        expected = 0
        client.receive(lambda: sum("fmu" in each["topic"] for each in client.channels.values()) == 2)
        client.send_control(PAUSE, 1.0, None, "first")
        client.receive(lambda: play() and not view.advance().is_playing)
        client.send_control(PLAY, 100.0, samples[20][1], "second")
        last = samples[-5:] if is_finished else samples[20:25]
        expected = len(last)
        client.receive(lambda: play() and set(last) <= set(client.samples))
        assert not set(samples[10:20]) & set(client.samples)
        assert any(b"second" in state for state in client.states)
        assert client.of("/pose")


def test_a_recording_without_samples_is_refused(tmp_path: Path, px4_types: Any) -> None:
    path = tmp_path / "flight.mcap"
    write(path, px4_types, 0)
    with pytest.raises(UnviewableRecordingError, match="has no samples"):
        channels_of(opening.open(path))


def test_types_are_chosen_by_the_definition(tmp_path: Path, px4_types: Any) -> None:
    class Other:
        @staticmethod
        def by_type(name: str) -> Any:
            raise KeyError(name)

    path = tmp_path / "flight.mcap"
    write(path, px4_types)
    recording = opening.open(path)
    assert package_for(recording, [Other, px4_types]) is px4_types  # type: ignore[list-item]
    assert package_for(recording, [Other]) is None  # type: ignore[list-item]
