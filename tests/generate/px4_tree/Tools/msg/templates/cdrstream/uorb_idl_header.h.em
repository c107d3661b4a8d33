@{
import genmsg.msgs

nested = [field for field in spec.parsed_fields() if not genmsg.msgs.is_builtin(field.base_type)]
}@
typedef struct @(name_snake_case)_s px4_msgs_msg_@(file_base_name);
@[for field in nested]@
// @(field.name): @(msg_context.get_registered(field.base_type).short_name), read: @(msg_context.get_file(field.base_type) is not None)
@[end for]@
/*
@spec.text*/
