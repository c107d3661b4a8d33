"""Compile messages and services of a package for rclpy, as colcon does, but only what rclpy needs, in a few seconds.

Run by the Python of an environment with the wheels of ROS 2. Arguments: the folder for the package, whose name is that
of the package, and .msg and .srv files. Nested messages are of `DEPENDENCIES`. The files must not contain constants.
"""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import rosidl_typesupport_c
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_adapter.srv import convert_srv_to_idl
from rosidl_cli.command.helpers import generate_visibility_control_file
from rosidl_generator_c import generate_c
from rosidl_generator_py import generate_py
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c

PREFIX = Path(sys.prefix)
DEPENDENCIES = ("builtin_interfaces", "service_msgs", "std_msgs", "geometry_msgs")
"""The packages that nested messages can be of, also those of events of services. The environment has them."""
LIBRARIES = ("rosidl_runtime_c", "rosidl_typesupport_c", "rosidl_typesupport_fastrtps_c", "fastcdr", "rcutils")
KINDS = ("rosidl_generator_c", "rosidl_generator_py", "rosidl_typesupport_fastrtps_c")
"""The libraries of each dependency."""


def generate(folder: Path, definitions: list[Path]) -> None:
    """Write the sources of a package."""
    package = folder.name
    convert = {"msg": convert_msg_to_idl, "srv": convert_srv_to_idl}
    names = []
    for definition in definitions:
        kind = definition.suffix.removeprefix(".")
        convert[kind](definition.parent, package, Path(definition.name), folder / kind)
        names.append(f"{kind}/{definition.stem}")

    def arguments(generator: str) -> str:
        written = {
            "package_name": package,
            "output_dir": str(folder),
            "template_dir": str(PREFIX / "share" / generator / "resource"),
            "idl_tuples": [f"{folder}:{name}.idl" for name in names],
            "ros_interface_files": [str(definition) for definition in definitions],
            "ros_interface_dependencies": [],
            "type_description_tuples": [f"{name}.idl:{folder}/{name}.json" for name in names],
            "target_dependencies": [],
            "include_paths": [f"{name}:{PREFIX / 'share' / name}" for name in DEPENDENCIES],
        }
        path = folder / f"{generator}.json"
        path.write_text(json.dumps(written), encoding="utf-8")
        return str(path)

    generate_type_hash(arguments("rosidl_generator_type_description"))
    generate_c(arguments("rosidl_generator_c"))
    generate_typesupport_fastrtps_c(arguments("rosidl_typesupport_fastrtps_c"))
    rosidl_typesupport_c.generate_c(arguments("rosidl_typesupport_c"), ["rosidl_typesupport_fastrtps_c"])
    generate_py(arguments("rosidl_generator_py"), ["rosidl_typesupport_c"])
    for generator in ("rosidl_generator_c", "rosidl_typesupport_fastrtps_c"):
        header = f"{generator}__visibility_control.h"
        template = PREFIX / "share" / generator / "resource" / f"{header}.in"
        generate_visibility_control_file(
            package_name=package, template_path=template, output_path=folder / "msg" / header
        )


def compile_sources(folder: Path) -> None:
    """Compile the sources into one library, which Python imports."""
    # the headers of Fast CDR are without a folder of their own; those of Debian are of another version
    of_ros = PREFIX / "include"
    headers = [folder.parent, of_ros, sysconfig.get_path("include"), np.get_include(), *of_ros.iterdir()]
    sources = sorted(path for path in folder.rglob("*") if path.suffix in {".c", ".cpp"})
    command = ["g++", "-shared", "-fPIC", "-O0", "-w", *(f"-I{header}" for header in headers)]
    languages = [argument for path in sources for argument in ("-x", "c" if path.suffix == ".c" else "c++", path)]
    libraries = [f"-L{PREFIX / 'lib'}", *(f"-l{name}" for name in LIBRARIES)]
    libraries += [f"-l{name}__{kind}" for name in DEPENDENCIES for kind in KINDS]
    library = folder / f"{folder.name}_s__rosidl_typesupport_c.so"
    subprocess.run([*command, *languages, "-x", "none", *libraries, "-o", library], check=True)


def main(folder: Path, definitions: list[Path]) -> None:
    """Generate and compile the package."""
    (folder / "msg").mkdir(parents=True)
    (folder / "__init__.py").touch()
    generate(folder, definitions)
    compile_sources(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
