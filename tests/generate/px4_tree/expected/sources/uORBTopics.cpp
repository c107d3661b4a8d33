#include <uORB/topics/cell_report.h>
#include <uORB/topics/fleet_status.h>
#include <uORB/topics/pack_status.h>
const orb_metadata *topics[] = {ORB_ID(cell_report), ORB_ID(fleet_status), ORB_ID(pack_status), ORB_ID(pack_status_backup), ORB_ID(pack_status_third)};
