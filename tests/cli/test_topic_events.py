"""Tests of `msggen topic echo --events`: what PX4's events say, where a firmware bridges them."""

from __future__ import annotations

import lzma
import re
from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.cli import main
from msggen.recordings.log.event_texts import event_texts
from msggen.sim import Options, Simulator
from support.events import METADATA, packed, write_events
from support.ports import free_port
from support.repository import ROOT

BRIDGED = "\n  - topic: /fmu/out/event\n    type: px4_msgs::msg::Event\n"


@pytest.mark.parametrize("form", ["metadata", "ULog", "packed ULog"])
def test_live_events_say_what_those_of_a_log_do(form: str, px4_types: Any, tmp_path: Path) -> None:
    path = write_events(tmp_path / "events.ulg")
    given = tmp_path / "given.xz"
    given.write_bytes(packed() if form == "metadata" else lzma.compress(Path(path).read_bytes()))
    texts = event_texts(path if form == "ULog" else str(given))
    with recordings.open(path) as log:
        messages = list(log.messages(px4_types.Event, topic="event"))
        assert len(messages) == len(log.events) > 5
        assert [texts.event(message) for message in messages] == list(log.events)


def test_echo_prints_what_events_say(working_folder: Path, capsys: Any) -> None:
    topics = (ROOT / "dds_topics.yaml").read_text(encoding="utf-8")
    Path("dds_topics.yaml").write_text(topics.replace("\nsubscriptions:", f"{BRIDGED}\nsubscriptions:", 1))
    assert (
        main(["build", "-q", "--px4", "v1.18", "--topics", "dds_topics.yaml", "--package", "own_types", "-o", "."]) == 0
    )
    metadata = {
        **METADATA,
        "components": {"0": {"event_groups": {"default": {"events": {"0": {"name": "zero", "message": "Take care"}}}}}},
    }
    Path("events.json.xz").write_bytes(packed(metadata))
    from msggen.cli.packages import import_package

    package = import_package(str(working_folder / "own_types"))
    url = f"udp://127.0.0.1:{free_port()}"
    words = ["topic", "echo", "event", "--once", "--types", "./own_types", "--direct", "--link", url]
    capsys.readouterr()
    with Simulator(package, url, [Options(sync="short")]):
        assert main([*words, "--events", "events.json.xz"]) == 0
        assert re.match(r"# emergency: Take care\ntimestamp: \d+", capsys.readouterr().out)
        assert main(words) == 0
        assert capsys.readouterr().out.startswith("timestamp: ")


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (None, "R102 cannot be read: No such file or directory"),
        (b"hello", "R102 is not a recording"),
        (lzma.compress(b"{}"), "R102 "),
        (packed()[:-20], "R102 "),
    ],
)
@pytest.mark.usefixtures("working_folder")
def test_a_file_without_texts_is_told_at_once(content: bytes | None, text: str, capsys: Any) -> None:
    if content is not None:
        Path("events.xz").write_bytes(content)
    assert main(["topic", "echo", "event", "--events", "events.xz"]) == 2
    assert f"events.xz: {text}" in capsys.readouterr().err


@pytest.mark.usefixtures("working_folder")
def test_other_forms_have_the_fields_alone(capsys: Any) -> None:
    Path("events.xz").write_bytes(packed())
    for form in ("--json", "--csv"):
        with pytest.raises(SystemExit):
            main(["topic", "echo", "event", "--events", "events.xz", form])
        assert "argument --events: not allowed with --json and --csv" in capsys.readouterr().err
