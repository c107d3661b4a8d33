"""Definitions of ROS 2's own packages for tests, with the names, types and constants of the packages."""

from __future__ import annotations

from pathlib import Path

from support.catalogs import write_definitions

DEFINITIONS = {
    "builtin_interfaces": {
        "msg/Duration.msg": "int32 sec\nuint32 nanosec\n",
        "msg/Time.msg": "int32 sec\nuint32 nanosec\n",
    },
    "std_msgs": {
        "msg/ColorRGBA.msg": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
        "msg/Empty.msg": "",
        "msg/Header.msg": "builtin_interfaces/Time stamp\nstring frame_id\n",
    },
    "geometry_msgs": {
        "msg/Point.msg": "float64 x\nfloat64 y\nfloat64 z\n",
        "msg/Pose.msg": "Point position\nQuaternion orientation\n",
        "msg/PoseStamped.msg": "std_msgs/Header header\nPose pose\n",
        "msg/Quaternion.msg": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
        "msg/Transform.msg": "Vector3 translation\nQuaternion rotation\n",
        "msg/Twist.msg": "Vector3 linear\nVector3 angular\n",
        "msg/Vector3.msg": "float64 x\nfloat64 y\nfloat64 z\n",
    },
    "std_srvs": {
        "srv/Empty.srv": "---\n",
        "srv/SetBool.srv": "bool data\n---\nbool success\nstring message\n",
    },
}

TYPE_HASHES = {
    "builtin_interfaces/msg/Time": "RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    "geometry_msgs/msg/Pose": "RIHS01_d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa",
    "geometry_msgs/msg/PoseStamped": "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/Twist": "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "geometry_msgs/msg/Vector3": "RIHS01_cc12fe83e4c02719f1ce8070bfd14aecd40f75a96696a67a2a1f37f7dbb0765d",
    "std_msgs/msg/Empty": "RIHS01_20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312",
    "std_msgs/msg/Header": "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
}
"""The type hashes that ROS 2 Kilted ships with these packages, computed by rosidl."""


def manifest(name: str) -> str:
    """Return a package.xml."""
    return f"<package format='3'><name>{name}</name></package>\n"


def ros_packages(*names: str, folder: Path = Path()) -> list[str]:
    """Write these packages, or all of them, into `folder`; return the options that name them."""
    for name in names or DEFINITIONS:
        write_definitions(folder / name, {**DEFINITIONS[name], "package.xml": manifest(name)})
    return [word for name in names or DEFINITIONS for word in ("--msg-dir", str(folder / name))]
