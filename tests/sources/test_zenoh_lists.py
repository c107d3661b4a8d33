"""Tests of PX4's list of topics for Zenoh: another way into the same registry."""

from __future__ import annotations

from pathlib import Path

import pytest

from msggen.cli import DONE, main
from msggen.definitions.identity import endpoints
from msggen.definitions.model import Catalog
from msggen.link.rmw_zenoh.names import parse_key
from msggen.messages.packages import zenoh_endpoints
from msggen.sim.endpoints import endpoints_of
from msggen.sim.options import Options
from msggen.sim.zenoh import zenoh_endpoints_of
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import find_sources
from support.catalogs import import_package, write_definitions
from support.firmware_trees import write_tree
from support.repository import ROOT, shared

OUT = (
    "register_ext_component_reply arming_check_request mode_completed battery_status collision_constraints "
    "estimator_status_flags failsafe_flags manual_control_setpoint position_setpoint_triplet sensor_combined "
    "timesync_status vehicle_land_detected vehicle_attitude vehicle_control_mode vehicle_command_ack "
    "vehicle_global_position vehicle_gps_position vehicle_local_position vehicle_odometry vehicle_status "
    "airspeed_validated"
)
IN = (
    "register_ext_component_request unregister_ext_component config_overrides_request arming_check_reply "
    "mode_completed distance_sensor manual_control_input offboard_control_mode onboard_computer_status "
    "obstacle_distance sensor_optical_flow goto_setpoint telemetry_status trajectory_setpoint "
    "vehicle_attitude_setpoint vehicle_mocap_odometry vehicle_rates_setpoint vehicle_visual_odometry vehicle_command "
    "vehicle_command_mode_executor vehicle_thrust_setpoint vehicle_torque_setpoint actuator_motors actuator_servos "
    "aux_global_position"
)
"""What both releases have."""
V1_17 = {"/fmu/in/config_control_setpoints"}
V1_18 = {"/fmu/out/setpoint_config_reply", "/fmu/out/config_overrides_confirm", "/fmu/in/setpoint_config"}
LISTED = {"v1.18": (V1_18, 49), "v1.17": (V1_17, 47)}

BRIDGE, ZENOH = "fw/src/modules/uxrce_dds_client/dds_topics.yaml", "fw/src/modules/zenoh/dds_topics.yaml"
STAMP = "uint64 timestamp\n"
ENTRY = "- topic: /fmu/out/{0}\n  type: px4_msgs::msg::{1}\n"
FILES = {
    "fw/msg/versioned/Rpm.msg": f"{STAMP}uint32 MESSAGE_VERSION = 3\nfloat32 rpm\n",
    "fw/msg/Winch.msg": f"{STAMP}float32 force\n# TOPICS winch winch_order\n",
    "fw/msg/Wheel.msg": STAMP,
    BRIDGE: "publications:\n" + ENTRY.format("rpm", "Rpm") + ENTRY.format("wheel", "Wheel"),
    ZENOH: "publications:\n"
    + ENTRY.format("winch", "Winch")
    + ENTRY.format("rpm", "Rpm")
    + "  options: {cc: block, express: true}\nsubscriptions:\n"
    + ENTRY.format("winch_order", "Winch").replace("out", "in"),
}
"""A tree in which each list has a topic of its own."""


def catalog_of_tree(changes: dict[str, str] | None = None) -> Catalog:
    """Return the catalog of a tree in the current folder."""
    write_definitions(Path(), FILES | (changes or {}))
    return read_catalog(find_sources("fw"))


@pytest.mark.parametrize("release", EMBEDDED)
def test_the_lists_of_releases_are_embedded(release: str) -> None:
    further, count = LISTED.get(release, (set(), 0))
    both = {f"/fmu/out/{name}" for name in OUT.split()} | {f"/fmu/in/{name}" for name in IN.split()} | further
    catalog = read_catalog(find_sources(release))
    names = [entry.topic for entry in catalog.zenoh]
    assert len(names) == count
    assert set(names) == (both if count else set())
    assert {entry.crossing for entry in catalog.zenoh} <= {entry.crossing for entry in catalog.bridge}
    assert not catalog.notices
    assert sum(each.zenoh is not None for each in endpoints(catalog)) == count


def test_the_embedded_list_is_that_of_the_firmware() -> None:
    embedded = read_catalog(find_sources("v1.18"))
    firmware = read_catalog(find_sources(str(shared("firmware/v1.18"))))
    ours, theirs = (
        [(*entry.crossing, entry.type_name, entry.options_text) for entry in each.zenoh]
        for each in (embedded, firmware)
    )
    assert ours == theirs


@pytest.mark.usefixtures("working_folder")
def test_endpoints_tell_whether_zenoh_has_them_and_with_which_key() -> None:
    catalog = catalog_of_tree()
    package = import_package(catalog, Path())
    topics = package.topics
    assert [each.ros_name for each in topics.ENDPOINTS] == [
        "/fmu/out/rpm_v3",
        "/fmu/out/wheel",
        "/fmu/out/winch",
        "/fmu/in/winch_order",
    ]
    assert [each.on_zenoh for each in topics.ENDPOINTS] == [True, False, True, True]
    assert [each.object_id for each in topics.ENDPOINTS] == [0, 1, None, None]
    rpm = topics.out.rpm
    key = parse_key(rpm.zenoh_key)
    assert key == (0, "/fmu/out/rpm", "px4_msgs/msg/Rpm", rpm.message.__msg__.type_hash)
    assert rpm.options == "cc=block,express=true"
    assert topics.out.wheel.zenoh_key == ""
    assert topics.namespaced("uav_1").out.rpm.zenoh_key == rpm.zenoh_key.replace("0/", "0/uav_1/", 1)
    assert [each.zenoh_key(catalog) for each in endpoints(catalog)] == [each.zenoh_key for each in topics.ENDPOINTS]
    assert topics.in_.winch_order.publish_interval_ms is None
    assert [each.ros_name for each in zenoh_endpoints(package)] == [
        "/fmu/out/rpm_v3",
        "/fmu/out/winch",
        "/fmu/in/winch_order",
    ]


@pytest.mark.usefixtures("working_folder")
def test_each_client_of_a_simulated_vehicle_has_the_topics_of_its_own_list() -> None:
    package = import_package(catalog_of_tree(), Path())
    bridged, on_zenoh = endpoints_of(package, Options()), zenoh_endpoints_of(package, Options())
    assert [each.name for each in bridged.publications] == ["/fmu/out/rpm_v3", "/fmu/out/wheel"]
    assert not bridged.inputs
    assert [each.name for each in on_zenoh.publications] == ["/fmu/out/rpm", "/fmu/out/winch"]
    assert [each.name for each in on_zenoh.inputs.values()] == ["/fmu/in/winch_order"]


@pytest.mark.usefixtures("working_folder")
def test_a_list_that_the_user_names_replaces_both() -> None:
    write_definitions(Path(), FILES)
    for place in (BRIDGE, ZENOH):
        catalog = read_catalog(find_sources("fw", topics=place))
        assert not catalog.zenoh
        assert all(each.zenoh is None and each.object_id is not None for each in endpoints(catalog))


@pytest.mark.parametrize(
    ("text", "code", "told"),
    [
        (ENTRY.format("rpm", "Wheel"), "Y207", "topic 'rpm' carries 'Rpm', found 'Wheel'"),
        (ENTRY.format("rpm", "Gone"), "Y207", "no message defines the type 'px4_msgs::msg::Gone'"),
        (ENTRY.format("gone", "Rpm"), "Y207", "no message declares the topic 'gone'"),
        (ENTRY.format("rpm", "Rpm") * 2, "Y207", "'/fmu/out/rpm' is already bridged on line 2"),
        (ENTRY.format("rpm", "Rpm") + "  rate_limit: 5\n", "Y106", "'rate_limit' has no effect in the list for Zenoh"),
        (ENTRY.format("rpm", "Rpm") + "  options: {cc: maybe}\n", "Y107", "'cc': expected drop, block; found maybe"),
        (
            ENTRY.format("rpm", "Rpm") + "  options: {expres: true}\n",
            "Y107",
            "unknown option 'expres', did you mean 'express'?",
        ),
        (ENTRY.format("rpm", "Rpm") + "  options: fast\n", "Y107", "'options': expected a mapping, found fast"),
    ],
)
@pytest.mark.usefixtures("working_folder")
def test_what_the_firmwares_script_takes_is_a_warning(
    text: str, code: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_definitions(Path(), FILES | {ZENOH: f"publications:\n{text}"})
    assert main(["build", "--px4", "fw", "-o", "out"]) == DONE
    (line,) = [line for line in capsys.readouterr().err.splitlines() if " warning: " in line]
    assert line.startswith(f"{ZENOH}:")
    assert f" {code} warning: {told}" in line


@pytest.mark.usefixtures("working_folder")
def test_check_tells_which_topics_are_on_one_list_only(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path(), FILES)
    arguments = ["check", "--px4", "fw", "fw"]
    assert main(arguments) == DONE
    captured = capsys.readouterr()
    assert f"{ZENOH}: Y208 note: 1 of 2 topics is not on Zenoh: /fmu/out/wheel" in captured.out + captured.err
    assert f"{BRIDGE}: Y208 note: 2 of 3 topics are not on DDS: /fmu/in/winch_order, /fmu/out/winch" in (
        captured.out + captured.err
    )
    assert main(["build", "--px4", "fw", "-o", "out"]) == DONE
    assert "Y208" not in capsys.readouterr().err


@pytest.mark.usefixtures("working_folder")
def test_topics_of_ones_own_are_told_first(capsys: pytest.CaptureFixture[str]) -> None:
    names = ["home_position", "input_rc", "vtx", "wind", "transponder_report", "wheel"]
    messages = {
        f"fw/msg/{name.title().replace('_', '')}.msg": STAMP for name in (*names, "rpm") if name not in ("wheel", "rpm")
    }
    lists = [ENTRY.format(name, name.title().replace("_", "")) for name in names]
    write_definitions(Path(), FILES | messages | {BRIDGE: "publications:\n" + "".join(lists)})
    assert main(["check", "--px4", "fw", "fw"]) == DONE
    captured = capsys.readouterr()
    text = captured.out + captured.err
    assert "6 of 6 topics are not on Zenoh: /fmu/out/wheel, /fmu/out/home_position" in text


@pytest.mark.usefixtures("working_folder")
def test_a_change_of_the_list_rebuilds_and_breaks_nothing_for_dds(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path("old"), FILES)
    write_definitions(Path(), FILES)
    assert main(["build", "--px4", "fw", "-o", "out"]) == DONE
    Path(ZENOH).write_text("publications:\n" + ENTRY.format("wheel", "Wheel"))
    assert main(["build", "--px4", "fw", "-o", "out"]) == DONE
    assert Path("out/px4_types/topics.py").read_text().count("on_zenoh=True") == 1
    assert main(["breaking", "--px4", "fw", "--against", "old/fw"]) == DONE
    assert "does not break" in capsys.readouterr().out


@pytest.mark.usefixtures("working_folder")
def test_the_page_shows_the_note_of_the_release(capsys: pytest.CaptureFixture[str]) -> None:
    write_tree(Path("PX4-Autopilot"), "v1.18", has_zenoh=True)
    assert main(["check", "--px4", "PX4-Autopilot", "PX4-Autopilot"]) == DONE
    captured = capsys.readouterr()
    (note,) = [line for line in (captured.out + captured.err).splitlines() if "Y208" in line]
    assert f"{note}\n" in (ROOT / "docs" / "zenoh.md").read_text()


@pytest.mark.parametrize("form", ["html", "markdown"])
@pytest.mark.usefixtures("working_folder")
def test_the_site_tells_what_is_on_zenoh(form: str) -> None:
    catalog = catalog_of_tree()
    assert main(["docs", "--px4", "fw", "-o", "site", "--format", form]) == DONE
    texts = {path.stem: path.read_text() for path in Path("site").rglob("*.*") if path.suffix in (".html", ".md")}
    keys = [each.zenoh_key(catalog) for each in endpoints(catalog) if each.zenoh]
    pages = [text for text in texts.values() if "Zenoh key" in text]
    assert len(pages) == len(keys) == 3
    assert all(any(key in page for page in pages) for key in keys)
    assert any("cc=block,express=true" in page for page in pages)
    rows = [line for line in texts["topics"].splitlines() if "/fmu/" in line and "PX4 publishes" not in line]
    assert [("yes" in row, ">no<" in row or "| no |" in row) for row in rows] == [(True, False), (False, True)] + [
        (True, False)
    ] * 2
    if form == "markdown":
        assert "| rate | Zenoh |\n|---|---|---|---|---|\n| [" in texts["topics"]
