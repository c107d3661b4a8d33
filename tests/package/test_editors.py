"""Tests that editors complete the generated package, and that type checkers refuse misspelt names.

jedi is the library behind vim, pylsp, Spyder and IPython; basedpyright that of Pylance and Neovim.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msggen.generate.python.package import TOOLS, render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, with_archived
from support.catalogs import catalog_of, write_definitions
from support.checkers import GENERATED, mypy
from support.completion import cell_of, names, script_of
from support.examples import by_day
from support.nested_packages import sources
from support.repository import ROOT


def completions(code: str, folder: Path = GENERATED) -> set[str]:
    return names(script_of(code, folder))


def hover(code: str) -> str:
    """Return what an editor shows for the name at the end of `code`."""
    return "\n".join(f"{found.description}\n{found.docstring()}" for found in script_of(code).help())


IMPORT = "from px4_types import EscStatus, SensorCombined, VehicleStatus, by_type, meaning, msg, show, topics\n"
COMPLETED = [
    ("import px4_types\npx4_types.Sens", {"SensorCombined", "SensorGps"}),
    ("import px4_types\npx4_types.", {"by_type", "cdr", "msg", "srv", "topics", "EncodeError", "EscStatus"}),
    ("from px4_types import Sens", {"SensorCombined"}),
    ("from px4_types.msg import Esc", {"EscReport", "EscStatus"}),
    (f"{IMPORT}msg.Esc", {"EscReport", "EscStatus"}),
    (f"{IMPORT}SensorCombined().gyro_", {"gyro_rad", "gyro_integral_dt"}),
    (f"{IMPORT}SensorCombined(gyro_", {"gyro_rad=", "gyro_integral_dt="}),
    (f"{IMPORT}SensorCombined.decode(b'').gyro_", {"gyro_rad", "gyro_integral_dt"}),
    (f"{IMPORT}VehicleStatus.lazy(b'').nav", {"nav_state"}),
    (f"{IMPORT}VehicleStatus.from_row(array[0]).nav", {"nav_state"}),
    (f"{IMPORT}VehicleStatus.__msg__.field('nav_state').un", {"unit"}),
    (f"{IMPORT}EscStatus().esc[0].esc_", {"esc_rpm", "esc_voltage"}),
    (f"{IMPORT}for report in EscStatus().esc:\n    report.esc_", {"esc_rpm", "esc_voltage"}),
    (f"{IMPORT}SensorCombined.CLIPP", {"CLIPPING_X", "CLIPPING_Y", "CLIPPING_Z"}),
    (f"{IMPORT}VehicleStatus.ARMING_STATE_ARMED.bit_", {"bit_count", "bit_length"}),
    (f"{IMPORT}EscStatus.__msg__.", {"definition", "fields", "constants", "type_hash"}),
    (f"{IMPORT}topics.", {"ORB_ID", "UORB", "endpoint", "in_", "out"}),
    (f"{IMPORT}topics.ORB_ID.vehicle_st", {"vehicle_status"}),
    (f"{IMPORT}topics.endpoint('/fmu/out/vehicle_status_v4').", {"dds_name", "message", "qos", "rate_limit_hz"}),
    (f"{IMPORT}topics.endpoint('/fmu/out/vehicle_status_v4').qos.reader.", {"reliability", "depth"}),
    (f"{IMPORT}topics.out.vehicle_st", {"vehicle_status"}),
    (f"{IMPORT}topics.in_.trajectory_set", {"trajectory_setpoint"}),
    (f"{IMPORT}topics.out.vehicle_status.", {"dds_name", "dds_type", "message", "qos"}),
    (f"{IMPORT}topics.namespaced('uav_1').out.vehicle_st", {"vehicle_status"}),
    (f"{IMPORT}topics.out.vehicle_status.message.ARMING", {"ARMING_STATE_ARMED"}),
    (f"{IMPORT}topics.out.vehicle_status.message().arming", {"arming_state"}),
    (f"{IMPORT}VehicleStatus.NavigationState.OFF", {"OFFBOARD"}),
    ("from px4_types import meaning\nmeaning.", {"is_valid", "of", "problems"}),
    ("from px4_types import EscStatus, meaning\nmeaning.problems(EscStatus())[0].", {"field", "kind", "text", "value"}),
    ("from px4_types import ", {*TOOLS, "show"} - {"ros", "versions"}),
    ("from px4_types import sho", {"show", "showing"}),
    ("from px4_types.srv import VehicleCommand\nVehicleCommand.Re", {"Request", "Response"}),
    ("from px4_types.srv import VehicleCommand\nVehicleCommand.Request().requ", {"request"}),
]


@by_day(("code", "expected"), COMPLETED, 14, ids=[code.splitlines()[-1] for code, _ in COMPLETED])
def test_jedi_completes_the_package(code: str, expected: set[str]) -> None:
    assert expected <= completions(code)


def test_jedi_completes_only_names_that_exist() -> None:
    assert completions(f"{IMPORT}topics.out.vehicle_statuss") == set()
    assert "load" not in completions("import px4_types\npx4_types.")
    assert not {"Direction", "in_namespace"} & completions(f"{IMPORT}topics.")


@by_day(
    ("code", "expected"),
    [
        ("SensorCombined", "Gyro and accelerometer readings"),
        ("SensorCombined.gyro_rad", "[rad/s]"),
        ("SensorCombined().gyro_rad", "[rad/s]"),
        ("EscStatus().esc[0].esc_power", "[%] [@range 0,100]"),
        ("VehicleStatus().nav_state", "[@enum NAVIGATION_STATE]"),
        ("VehicleStatus.NavigationState.OFFBOARD", "Values of `nav_state_user_intention`"),
        ("meaning.problems", "outside the range of their field"),
        ("show", "Return a message as text"),
        ("VehicleStatus.ARMING_STATE_ARMED", "= 2"),
        ("topics.ENDPOINTS", "in the order of dds_topics.yaml"),
        ("topics.ORB_ID.vehicle_status", "The topic ids of the firmware"),
        ("topics.out.vehicle_status", "`rt/fmu/out/vehicle_status_v4`, every"),
        ("EscStatus.__msg__.definition", "ros2msg"),
        ("by_type", "Return the class of a recorded type"),
    ],
    7,
)
def test_jedi_shows_documentation(code: str, expected: str) -> None:
    assert expected in hover(IMPORT + code)


COMPLETE = "from support.completion import names, script_of; print(names(script_of('import px4_types\\npx4_types.cd')))"


@pytest.mark.night  # two processes, each with an empty cache
def test_a_cache_that_another_process_has_damaged_does_not_matter(tmp_path: Path) -> None:
    """A process of tests is killed while it writes to the cache of the user, or has written half of a file."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(ROOT / "tests")}
    shared = f"import jedi, support.completion; jedi.settings.cache_directory = {str(tmp_path)!r} + '/jedi'; {COMPLETE}"
    for program in (shared, COMPLETE):
        done = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
        )
        assert done.stdout == "{'cdr'}\n", done.stderr
        for cached in tmp_path.rglob("*.pkl"):
            cached.write_bytes(cached.read_bytes()[:20])
    assert [*tmp_path.rglob("*.pkl")] != []


def test_only_one_module_of_the_tests_imports_jedi() -> None:
    """It gives each process a cache of its own."""
    modules = (ROOT / "tests").rglob("*.py")
    users = [path.name for path in modules if re.search(r"^\s*(import|from) jedi\b", path.read_text(), re.MULTILINE)]
    assert users == ["completion.py"]


def test_ipython_completes_the_imported_package(px4_types: Any) -> None:
    def completed(code: str) -> set[str]:
        return names(cell_of(code, {"px4_types": px4_types}))

    assert "SensorCombined" in completed("px4_types.Sens")
    assert {"show", *TOOLS} - {"ros", "versions"} <= {*dir(px4_types)}
    assert {*dir(px4_types)} <= completed("px4_types.")
    assert len(set(dir(px4_types))) == len(dir(px4_types))
    assert "vehicle_status" in completed("px4_types.topics.out.vehicle_st")
    assert "esc_rpm" in completed("px4_types.EscReport().esc_r")


def test_jedi_completes_other_packages_and_archived_versions(tmp_path: Path) -> None:
    write_definitions(tmp_path / "nested", dict(render_package(sources(tmp_path / "in" / "nested"), "nested")))
    assert "Pose" in completions("from nested.geometry_msgs.msg import Po", tmp_path)
    assert {"geometry_msgs", "std_srvs"} <= completions("import nested\nnested.", tmp_path)
    assert "sec" in completions("import nested\nnested.Rig().stamp.se", tmp_path)
    files = {
        "msg/versioned/Lamp.msg": "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\nbool lit\n",
        "msg/px4_msgs_old/msg/LampV0.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nuint8 lights\n",
    }
    catalog = read_catalog(with_archived(find_sources(str(write_definitions(tmp_path / "fw", files)))))
    write_definitions(tmp_path / "lamps", dict(render_package(catalog, "lamps")))
    assert {"Lamp", "LampV0"} <= completions("from lamps import La", tmp_path)
    assert "lights" in completions("from lamps import LampV0\nLampV0().li", tmp_path)
    assert "upgrade" in completions("from lamps import LampV0\nLampV0().upg", tmp_path)


MISSPELT = """
from px4_types import SensorCombine
from px4_types.msg import EscStatuss
from px4_types import SensorCombined, VehicleStatus, msg, topics, topix
import px4_types
px4_types.SensorCombine
msg.SensorCombine
SensorCombined().gyro_radd
SensorCombined.CLIPPING_W
SensorCombined(gyro_radd=(0.0, 0.0, 0.0))
topics.ORB_ID.vehicle_statuss
topics.endpoints
topics.out.vehicle_statuss
topics.in_.trajectory_setpoints
topics.out.vehicle_status.message.ARMING_STATE_ARMD
topics.out.vehicle_status.dds_nam
topics.namespaced("uav_1").out.vehicle_statuss
VehicleStatus.__msg__.ros_typ
px4_types.cdr.MessageInf
VehicleStatus.NavigationState.OFFBORD
px4_types.meaning.problem
"""
CORRECT = """
from px4_types import VehicleStatus, by_type, meaning, show, topics

cls: type[VehicleStatus] = topics.out.vehicle_status.message
state: int = topics.out.vehicle_status.message.decode(b"").arming_state
endpoint: topics.Endpoint[VehicleStatus] = topics.out.vehicle_status
every: tuple[topics.Endpoint, ...] = topics.ENDPOINTS
within: tuple[topics.Endpoint, ...] = topics.namespaced("uav_1")
named: topics.Endpoint[VehicleStatus] = topics.namespaced("uav_1").out.vehicle_status
text: str = by_type("px4_msgs/msg/EscStatus").__msg__.definition
name: str = topics.endpoint("/fmu/out/vehicle_status_v4").message.__msg__.name
unit: str = VehicleStatus.__msg__.field("timestamp").unit
offboard: VehicleStatus.NavigationState = VehicleStatus.NavigationState.OFFBOARD
problems: tuple[meaning.Problem, ...] = meaning.problems(VehicleStatus(nav_state=offboard))
shown: str = show(VehicleStatus())
"""


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("programs")
    return write_definitions(folder, {"misspelt.py": MISSPELT, "correct.py": CORRECT})


EVERY_LINE = {number for number, line in enumerate(MISSPELT.splitlines(), 1) if line and line != "import px4_types"}


@pytest.mark.slow
def test_mypy_refuses_misspelt_names(programs: Path) -> None:
    done = mypy(programs, "misspelt.py", "correct.py", path=GENERATED)
    found = [line.split(":")[:2] for line in done.stdout.splitlines()]
    assert {path for path, _ in found} == {"misspelt.py"}, done.stdout
    assert {int(number) for _, number in found} == EVERY_LINE


@pytest.mark.night  # each run does it with mypy
def test_basedpyright_refuses_misspelt_names(programs: Path) -> None:
    settings = {"typeCheckingMode": "standard", "extraPaths": [str(GENERATED)], "reportUnusedExpression": False}
    (programs / "pyrightconfig.json").write_text(json.dumps(settings))
    command = [sys.executable, "-m", "basedpyright", "--outputjson", "--pythonpath", sys.executable, "--level", "error"]
    done = subprocess.run(command, cwd=programs, capture_output=True, text=True, check=False)
    found = [
        (Path(each["file"]).name, each["range"]["start"]["line"] + 1)
        for each in json.loads(done.stdout)["generalDiagnostics"]
    ]
    assert {path for path, _ in found} == {"misspelt.py"}, done.stdout
    assert {number for _, number in found} == EVERY_LINE


@pytest.mark.night  # each run checks the package strictly, in tests/repository/test_quality.py
def test_the_public_types_are_complete() -> None:
    """numpy's own types are incomplete, so types of other packages are ignored."""
    options = ["--pythonpath", sys.executable, "--verifytypes", "px4_types", "--ignoreexternal", "--outputjson"]
    command = [sys.executable, "-m", "basedpyright", *options]
    environment = {**os.environ, "PYTHONPATH": str(GENERATED)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    report = json.loads(done.stdout)["typeCompleteness"]
    incomplete = [symbol["name"] for symbol in report["symbols"] if not symbol["isTypeKnown"]]
    assert report["completenessScore"] > 0.95, incomplete[:20]


UNUSUAL = {
    "msg/Import.msg": "uint64 timestamp\n# TOPICS import from_gps other\n",
    "dds_topics.yaml": "publications:\n"
    "  - topic: /fmu/out/import\n    type: px4_msgs::msg::Import\n"
    "  - topic: /fmu/out/other\n    type: px4_msgs::msg::Import\n    instance: 0\n"
    "  - topic: /fmu/out/other\n    type: px4_msgs::msg::Import\n    instance: 1\n"
    "subscriptions:\n"
    "  - topic: /fmu/in/import\n    type: px4_msgs::msg::Import\n"
    "  - topic: /second/in/import\n    type: px4_msgs::msg::Import\n",
}


def test_attributes_of_endpoints_are_unique(tmp_path: Path) -> None:
    """A keyword gets an underscore, an instance its number, and further endpoints of a topic an underscore."""
    catalog = catalog_of(tmp_path / "in", UNUSUAL)
    write_definitions(tmp_path / "odd", dict(render_package(catalog, "odd")))
    program = "from odd import topics\nprint(dir(topics.out), dir(topics.in_), topics.out.other1.instance)"
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "['import_', 'other0', 'other1'] ['import_', 'import__'] 1\n"
    assert completions("from odd import topics\ntopics.out.imp", tmp_path) == {"import_"}


def test_every_endpoint_is_an_attribute(px4_types: Any) -> None:
    topics = px4_types.topics
    named = [getattr(side, name) for side in (topics.out, topics.in_) for name in dir(side)]
    assert sorted(map(topics.ENDPOINTS.index, named)) == list(range(len(topics.ENDPOINTS)))
    assert topics.out.vehicle_status.ros_name == "/fmu/out/vehicle_status_v4"
    with pytest.raises(
        AttributeError, match=r"^no endpoint 'out\.vehicle_statuss', did you mean 'out\.vehicle_status'\?$"
    ):
        _ = topics.out.vehicle_statuss


def test_a_package_without_a_bridge_has_no_endpoints(tmp_path: Path) -> None:
    catalog = catalog_of(tmp_path / "in", {"msg/Lamp.msg": "uint64 timestamp\n"})
    write_definitions(tmp_path / "bare", dict(render_package(catalog, "bare")))
    program = "from bare import topics\nprint(dir(topics.out), dir(topics.in_), topics.ENDPOINTS)"
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "[] [] ()\n"
