@[for name in sorted(name.replace('.msg', '') for name in msgs)]@
#include <uORB/topics/@(name).h>
@[end for]@
const orb_metadata *topics[] = {@(', '.join('ORB_ID(%s)' % topic for topic in all_topics))};
