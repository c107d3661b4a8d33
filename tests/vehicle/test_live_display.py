"""Tests of a vehicle, a subscription and a message in IPython and Jupyter."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from IPython.core.formatters import DisplayFormatter

from msggen.live import Vehicle
from msggen.sim import Options, Simulator
from msggen.vehicle import display
from support.fake_link import FakeLink
from support.ports import free_port
from support.repository import ROOT

PAGE = (ROOT / "docs" / "vehicle.md").read_text()
SECOND = 1_000_000_000


class Texts(HTMLParser):
    """The texts of a page, and the elements that are open."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, _attributes: object) -> None:
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts += [data.strip()] if data.strip() else []


def texts_of(html: str) -> list[str]:
    """Return the texts of HTML, all of whose elements end."""
    parser = Texts()
    parser.feed(html)
    parser.close()
    assert parser.open == []
    return parser.texts


def shown(value: object) -> dict[str, str]:
    """Return the texts of a value, by their types, as Jupyter gets them."""
    formatter: Any = DisplayFormatter  # without types
    texts: dict[str, str] = formatter().format(value)[0]
    return texts


def html_of(value: object) -> list[str]:
    return texts_of(shown(value)["text/html"])


def after(texts: list[str], name: str) -> str:
    return texts[texts.index(name) + 1]


@pytest.fixture
def link(px4_types: Any) -> FakeLink:
    return FakeLink(px4_types)


def test_a_vehicle_shows_what_is_known(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        assert after(html_of(vehicle), "state") == "not connected"
        remote = link.connect(key=7, namespace="uav_1")
        status, payloads = vehicle.subscribe("vehicle_status"), vehicle.subscribe("sensor_combined", raw=True)
        for number in range(5):
            link.sample(remote, px4_types.VehicleStatus(), when=(10 + number) * SECOND // 10)
        texts = html_of(vehicle)
        assert after(texts, "state") == "connected"
        assert after(texts, "vehicle") == "the vehicle at 127.0.0.1:40000 (key 7, namespace uav_1)"
        assert after(texts, "firmware").endswith("(so far)")
        place = texts.index("/fmu/out/vehicle_status")
        assert texts[place : place + 6] == ["/fmu/out/vehicle_status", "VehicleStatus", "5", "10.0 Hz", "5", "0"]
        assert after(texts, "/fmu/out/sensor_combined") == "bytes"
        assert f"{len(px4_types.topics.ENDPOINTS)} topics in the namespace uav_1" in texts
        assert after(texts, "/uav_1/fmu/in/trajectory_setpoint") == "TrajectorySetpoint"
        assert len(status) == 5
        assert payloads.received == 0
    assert after(html_of(vehicle), "state") == "closed"


def test_a_subscription_shows_its_newest_message(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        subscription = vehicle.subscribe("vehicle_status", queue=2)
        assert "no message yet" in html_of(subscription)
        remote = link.connect()
        for number in range(4):
            link.sample(remote, px4_types.VehicleStatus(nav_state=14), when=(10 + number) * SECOND)
        texts = html_of(subscription)
        counts = {name: after(texts, name) for name in ("state", "samples", "mean rate", "waiting", "dropped")}
        assert counts == {"state": "open", "samples": "4", "mean rate": "1.0 Hz", "waiting": "2", "dropped": "2"}
        assert after(texts, "nav_state") == "OFFBOARD (14)"
        assert after(texts, "armed_time") == "0"
        assert len(subscription) == 2
        subscription.close()
        assert after(html_of(subscription), "state") == "closed"


def test_invalid_samples_are_shown_and_not_counted_again(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        status, payloads = vehicle.subscribe("vehicle_status"), vehicle.subscribe("vehicle_status", raw=True)
        remote = link.connect()
        link.sample(remote, b"\0\1\0\0\1", "vehicle_status")
        assert any(text.startswith("VehicleStatus.timestamp: expected 83 bytes") for text in html_of(status))
        assert status.undecodable == 0
        assert "5 bytes" in html_of(payloads)


def test_a_difference_of_definitions_is_shown(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        status = vehicle.subscribe(px4_types.VehicleStatus)
        remote = link.connect()
        link.sample(remote, px4_types.SensorCombined())
        link.answer(remote, {"vehicle_status": 1})
        assert "has the hash 0x00000001" in after(html_of(status), "error")


def test_names_are_escaped(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        link.connect(namespace="<script>alert(1)</script>", address="<b>&")
        html = shown(vehicle)["text/html"]
        assert "<script" not in html
        assert "<b>" not in html
        assert any("<script>alert(1)</script>" in text for text in texts_of(html))


def refuse(*_: object) -> str:
    raise RuntimeError("dictionary changed size during iteration")


@pytest.mark.parametrize("function", ["html_of_vehicle", "html_of_subscription"])
def test_a_display_that_fails_leaves_the_text(
    function: str, link: FakeLink, px4_types: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(display, function, refuse)
    with Vehicle(link, px4_types) as vehicle:
        value = vehicle if function == "html_of_vehicle" else vehicle.subscribe("vehicle_status")
        assert {*shown(value)} == {"text/plain"}
    assert capsys.readouterr().err == ""


def test_packages_of_an_earlier_msggen_are_shown_as_text(
    link: FakeLink, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(px4_types.cdr.Message, "_repr_html_")
    with Vehicle(link, px4_types) as vehicle:
        subscription = vehicle.subscribe("vehicle_status")
        link.sample(link.connect(), px4_types.VehicleStatus(nav_state=14))
        assert any("nav_state=14" in text for text in html_of(subscription))


def test_a_display_waits_for_nothing(link: FakeLink, px4_types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The counters of a link that others own are a question to its owner, which can take long to answer."""
    monkeypatch.setattr(link, "statistics", refuse)
    with Vehicle(link, px4_types) as vehicle:
        link.connect()
        assert "text/html" in shown(vehicle)


def test_firmware_is_one_line(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        remote = link.connect()
        assert repr(vehicle.firmware).endswith(" (so far)>")
        link.sample(remote, px4_types.SensorCombined())
        link.answer(remote)
        assert repr(vehicle.firmware) == "<Firmware v1.18>"


@pytest.fixture
def environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The environment for IPython and Jupyter, with settings of their own."""
    path = [str(ROOT), str(ROOT / "generated"), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    changes = {"PYTHONPATH": os.pathsep.join(filter(None, path)), "IPYTHONDIR": str(tmp_path / "ipython")}
    for name in ("CONFIG_DIR", "DATA_DIR", "RUNTIME_DIR"):
        changes[f"JUPYTER_{name}"] = str(tmp_path / name)
    for name, value in changes.items():
        monkeypatch.setenv(name, value)
    return {**os.environ}


def test_the_session_of_the_page_is_real(px4_types: Any, environment: dict[str, str]) -> None:
    block = re.search(r"```text\n(In \[1\].*?)```", PAGE, re.DOTALL)
    assert block is not None
    url = f"udp://127.0.0.1:{free_port()}"
    lines = "\n".join(re.findall(r"^In \[\d+\]: (.*)$", block[1], re.MULTILINE))
    options = ["--simple-prompt", "--no-banner", "--no-confirm-exit", "--colors=NoColor"]
    command = [sys.executable, "-m", "IPython", *options, "--HistoryManager.enabled=False"]
    with Simulator(px4_types, url, [Options(sync="off", rate=10.0)]):
        code = lines.replace("udp://127.0.0.1:8888", url) + "\n"
        done = subprocess.run(
            command, input=code, env=environment, capture_output=True, text=True, timeout=120, check=True
        )
    shape: Callable[[str], str] = lambda text: re.sub(r"[\d.]+", "0", text)  # noqa: E731
    expected = block[1].partition("Out[3]: ")[2].strip()
    assert shape(expected) in shape(done.stdout), done.stdout


CELLS = (
    "import px4_types; from msggen.live import Vehicle; vehicle = Vehicle('URL', px4_types); vehicle",
    "attitude = vehicle.subscribe('vehicle_attitude'); attitude.wait_for(bool, timeout=30)",
    "attitude",
    "vehicle",
    "[attitude.latest()]",
)


@pytest.mark.night  # a kernel of its own; by day, IPython shows the same
@pytest.mark.usefixtures("environment")
def test_a_notebook_shows_tables(px4_types: Any) -> None:
    """A headless notebook, in a kernel of its own."""
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    from nbformat import v4

    url = f"udp://127.0.0.1:{free_port()}"
    new: Any = v4  # without types
    notebook = new.new_notebook(cells=[new.new_code_cell(cell.replace("URL", url)) for cell in CELLS])
    with Simulator(px4_types, url, [Options(sync="off", rate=10.0)]):
        nbclient.NotebookClient(notebook, timeout=60, kernel_name="python3").execute()
    outputs = [{**cell["outputs"][0]["data"]} for cell in notebook["cells"]]
    first, message, subscription, connected, several = outputs
    assert after(texts_of(first["text/html"]), "state") == "not connected"
    assert {"VehicleAttitude", "quat_reset_counter"} <= {*texts_of(message["text/html"])}
    assert message["text/plain"].startswith("VehicleAttitude\n  timestamp ")
    assert {"open", "quat_reset_counter"} <= {*texts_of(subscription["text/html"])}
    assert after(texts_of(connected["text/html"]), "state") == "connected"
    assert {*several} == {"text/plain"}
