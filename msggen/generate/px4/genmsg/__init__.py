"""The `genmsg` of templates: the names of the genmsg package that the firmware's templates use, on msggen's model.

tests/generate/px4_names.md lists the names. This is not the genmsg package; only the names are the same.
"""

from msggen.generate.px4.genmsg import gentools, msg_loader, msgs, names
from msggen.generate.px4.genmsg.msg_loader import MsgContext, MsgNotFound, load_depends, load_msg_by_type
from msggen.generate.px4.genmsg.msgs import Constant, Field, MsgSpec
from msggen.generate.px4.genmsg.names import package_resource_name

__all__ = [
    "Constant",
    "Field",
    "MsgContext",
    "MsgNotFound",
    "MsgSpec",
    "gentools",
    "load_depends",
    "load_msg_by_type",
    "msg_loader",
    "msgs",
    "names",
    "package_resource_name",
]
