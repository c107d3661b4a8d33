"""Definitions that nest messages of other ROS packages, several with the same name."""

from __future__ import annotations

from pathlib import Path

from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.repository import ROOT
from support.ros_packages import ros_packages

STAMP = "uint64 timestamp\n"
UORB = {
    "msg/Rpm.msg": (ROOT / "msg" / "Rpm.msg").read_text(),
    "msg/Rig.msg": f"{STAMP}geometry_msgs/Pose[3] poses\nbuiltin_interfaces/Time stamp\nuint8 kind\n"
    "my_msgs/Time other\nmy_msgs/Time[5] others\nRpm rpm\n",
    "msg/Named.msg": f"{STAMP}my_msgs/Final final\nmy_msgs/Sequence sequence\n",
    "srv/Move.srv": "geometry_msgs/Twist twist\n---\nmy_msgs/Time time\nbuiltin_interfaces/Time[2] stamps\n",
}
MINE = {
    "msg/Time.msg": "uint8 a\nbuiltin_interfaces/Time stamp\nbuiltin_interfaces/Time[2] two\n",
    "msg/Twist.msg": "geometry_msgs/Twist twist\nTime time\nbool[3] flags\nfloat32[20] values\n",
    "msg/Track.msg": "Twist[2] twists\nmy_msgs/Twist twist\npx4_msgs/Rpm rpm\n",
    "msg/Final.msg": "uint8 A = 1\nuint8 int\nuint8[4] bytes\n",
    "msg/Sequence.msg": "uint16[20] values\n",
    "msg/Header.msg": "std_msgs/Header header\nuint8 x\n",
    "msg/Log.msg": "std_msgs/Header[] headers\nHeader[<=3] mine\nTime time\nbuiltin_interfaces/Time[] stamps\n"
    "std_msgs/Empty nothing\nRig rig_of_mine\n",
    "msg/Rig.msg": "px4_msgs/Rig rig\nstring name\n",
    "srv/Aim.srv": "geometry_msgs/Transform aim\n---\nTime time\nbuiltin_interfaces/Time stamp\nstd_msgs/Header h\n",
}


def sources(folder: Path) -> Catalog:
    """Return the catalog of UORB, MINE and ROS 2's packages."""
    write_definitions(folder / "px4", UORB)
    write_definitions(folder / "mine", MINE)
    folders = [path for path in ros_packages(folder=folder) if path != "--msg-dir"]
    return read_catalog(find_sources(str(folder / "px4"), (*folders, f"my_msgs={folder / 'mine'}")))
