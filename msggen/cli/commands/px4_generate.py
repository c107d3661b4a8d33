"""`msggen px4-generate`: run the firmware's own templates in place of its generator scripts."""

from __future__ import annotations

import argparse
import os

from msggen.cli.options import Run, add_value, new_command
from msggen.cli.values import local_path, non_empty


@new_command(
    "px4-generate",
    "run the firmware's own templates in place of its scripts",
    "Generate the same files as the firmware's px_generate_uorb_topic_files.py and "
    "generate_dds_topics.py, from the same templates and arguments. Files that would not change are not written.",
    writes=True,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    _add_messages(parser)
    _add_bridge(parser)
    return _generate


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
    add_value(messages, "-f", "FILE", local_path, ".msg files", dest="file", nargs="+")
    add_value(
        messages, "-i", "DIR", local_path, "folders of the messages that they nest", dest="include_paths", nargs="*"
    )
    add_value(messages, "-o", "DIR", local_path, "folder to write to", dest="outputdir")
    add_value(messages, "-e", "DIR", local_path, "folder of templates", dest="templatedir")
    add_value(messages, "-k", "NAME", non_empty, "package name (default: px4)", dest="package", default="px4")
    messages.add_argument("-p", dest="prefix", metavar="PREFIX", help="accepted and ignored, as by the script")


def _add_bridge(parser: argparse.ArgumentParser) -> None:
    bridge = parser.add_argument_group("bridge (generate_dds_topics.py)")
    add_value(bridge, "-y, --dds-topics-file", "FILE", local_path, "dds_topics.yaml", dest="yaml_file")
    add_value(bridge, "-t, --template_file", "FILE", local_path, "template file")
    add_value(bridge, "-u, --client-outdir", "DIR", local_path, "folder to write to", dest="clientdir")
    bridge.add_argument("-m", "--topic-msg-dir", metavar="DIR", help="accepted and ignored: an option of older scripts")


def _generate(options: argparse.Namespace) -> None:
    wants_bridge = any((options.yaml_file, options.template_file, options.clientdir))
    if wants_bridge and (options.kind or options.file):
        options.parser.error("options for messages and for the bridge cannot be combined: use two runs")
    folder, files = _bridge(options) if wants_bridge else _messages(options)
    from msggen.base.disk.output import write_stale_files

    write_stale_files(folder, files)


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
