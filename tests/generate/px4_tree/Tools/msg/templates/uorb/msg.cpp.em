@{
from px_generate_uorb_topic_helper import *

def lines(fields):
    for field in fields:
        yield field.type + ' ' + field.name
        if not field.is_builtin:
            yield from lines(fields_of(field.base_type, search_path))

queue_length = {each.name: each.val for each in spec.constants}.get('ORB_QUEUE_LENGTH', 1)
}@
// @(' | '.join(lines(spec.parsed_fields())))
// nests: @(' '.join(msg_context.get_all_depends(spec.full_name)))
@[for topic in topics]@
ORB_DEFINE(@topic, @(all_topics.index(topic)), @queue_length);
@[end for]
