"""`msggen px4-generate`: run the firmware's own templates in place of its generator scripts."""

from __future__ import annotations

import argparse
import os

from msggen.base.exit_codes import DONE
from msggen.cli.options import Commands, add_command
from msggen.cli.values import local_path, non_empty


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "px4-generate",
        _generate,
        writes=True,
        help="run the firmware's own templates in place of its scripts",
        description="Generate the same files as the firmware's px_generate_uorb_topic_files.py and "
        "generate_dds_topics.py, from the same templates and arguments. Files that would not change are not written.",
    )
    _add_messages(parser)
    _add_bridge(parser)


def _add_messages(parser: argparse.ArgumentParser) -> None:
    messages = parser.add_argument_group("messages (px_generate_uorb_topic_files.py)")
    kind = messages.add_mutually_exclusive_group()
    for option, text in (
        ("--headers", "C++ headers"),
        ("--sources", "C++ sources"),
        ("--json", "field lists"),
        ("--uorb-idl-header", "headers for Cyclone DDS"),
    ):
        kind.add_argument(option, dest="kind", action="store_const", const=option, help=text)
    messages.add_argument("-f", dest="file", metavar="FILE", type=local_path, nargs="+", help=".msg files")
    messages.add_argument(
        "-i",
        dest="include_paths",
        metavar="DIR",
        type=local_path,
        nargs="*",
        help="folders of the messages that they nest",
    )
    messages.add_argument("-o", dest="outputdir", metavar="DIR", type=local_path, help="folder to write to")
    messages.add_argument("-e", dest="templatedir", metavar="DIR", type=local_path, help="folder of templates")
    messages.add_argument(
        "-k", dest="package", metavar="NAME", type=non_empty, default="px4", help="package name (default: px4)"
    )
    messages.add_argument("-p", dest="prefix", metavar="PREFIX", help="accepted and ignored, as by the script")


def _add_bridge(parser: argparse.ArgumentParser) -> None:
    bridge = parser.add_argument_group("bridge (generate_dds_topics.py)")
    bridge.add_argument(
        "-y", "--dds-topics-file", dest="yaml_file", metavar="FILE", type=local_path, help="dds_topics.yaml"
    )
    bridge.add_argument("-t", "--template_file", metavar="FILE", type=local_path, help="template file")
    bridge.add_argument(
        "-u", "--client-outdir", dest="clientdir", metavar="DIR", type=local_path, help="folder to write to"
    )
    bridge.add_argument("-m", "--topic-msg-dir", metavar="DIR", help="accepted and ignored: an option of older scripts")


def _generate(options: argparse.Namespace) -> int:
    wants_bridge = any((options.yaml_file, options.template_file, options.clientdir))
    if wants_bridge and (options.kind or options.file):
        options.parser.error("options for messages and for the bridge cannot be combined: use two runs")
    folder, files = _bridge(options) if wants_bridge else _messages(options)
    from msggen.base.disk.output import write_stale_files

    write_stale_files(folder, files)
    return DONE


def _messages(options: argparse.Namespace) -> tuple[str, dict[str, str]]:
    if not options.kind:
        options.parser.error("expected one of --headers, --sources, --json, --uorb-idl-header; or -y, -t and -u")
    _require(options, {"file": "-f", "outputdir": "-o", "templatedir": "-e"})
    if not options.package.isidentifier():
        options.parser.error(f"-k '{options.package}': expected a name such as 'px4'")
    from msggen.generate.px4.messages import Kind, Request, generate_messages

    kinds = {
        "--headers": Kind.HEADERS,
        "--sources": Kind.SOURCES,
        "--json": Kind.JSON,
        "--uorb-idl-header": Kind.IDL_HEADERS,
    }
    includes = tuple(options.include_paths or ())
    request = Request(kinds[options.kind], tuple(options.file), includes, options.templatedir, options.package)
    return options.outputdir, generate_messages(request)


def _bridge(options: argparse.Namespace) -> tuple[str, dict[str, str]]:
    _require(options, {"yaml_file": "-y", "template_file": "-t", "clientdir": "-u"})
    from msggen.generate.px4.bridge import BridgeRequest, generate_bridge

    namespace = os.environ.get("PX4_UXRCE_DDS_NS", "")
    return options.clientdir, generate_bridge(BridgeRequest(options.yaml_file, options.template_file, namespace))


def _require(options: argparse.Namespace, names: dict[str, str]) -> None:
    missing = [option for name, option in names.items() if not getattr(options, name)]
    if missing:
        options.parser.error(f"expected {', '.join(missing)} too")
