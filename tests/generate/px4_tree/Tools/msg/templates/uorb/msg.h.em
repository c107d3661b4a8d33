@# A small template with the names that the firmware's header template uses.
@{
import genmsg.msgs
import re

from px_generate_uorb_topic_helper import *

fields = sorted(spec.parsed_fields(), key=size_of, reverse=True)
total = pad(fields, search_path)
}@
// @(spec.full_name) from @file_name_in: @(len(spec.parsed_fields())) fields, @(total) bytes
@{
for field in spec.parsed_fields():
    if not field.is_builtin and not field.is_header:
        package, name = genmsg.names.package_resource_name(field.base_type)
        print('#include <uORB/topics/%s.h>' % re.sub(r'(?<!^)(?=[A-Z])', '_', name).lower())
}@
@[for constant in spec.constants]@
#define @(name_snake_case.upper())_@(constant.name) @(int(constant.val)) // @constant.type
@[end for]@
struct @(name_snake_case)_s {
@{
def print_all():
    for field in fields:
        print_field(field)
}@
@print_all()@
};
namespace @(spec.package)::msg { using @(spec.short_name) = @(name_snake_case)_s; }
@[for topic in topics]@
ORB_DECLARE(@topic);
@[end for]
