@[for each in type_includes]@
#include <uORB/topics/@(each).h>
@[end for]@
// namespace '@namespace'
@[for pub in publications]@
{ ORB_ID(@(pub['topic_simple'])), "@(pub['dds_type'])", "@(pub['topic'])", @(pub['simple_base_type'])_s, @(pub.get('rate_limit', 0)), @(pub['publish_interval_ms'] if pub['publish_interval_ms'] is not None else 'DEFAULT'), @(pub['instance']) },
@[end for]@
@[for index, sub in enumerate(subscriptions + subscriptions_multi)]@
case @index: @(sub['topic_simple']) of @(sub['type']), "@(sub['topic'])", by '@(sub.get('route_field'))', depth @(sub.get('max_instances', 2))
@[end for]
