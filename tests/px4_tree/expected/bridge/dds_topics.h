#include <uORB/topics/fleet_status.h>
#include <uORB/topics/pack_status.h>
// namespace 'uav_1'
{ ORB_ID(pack_status), "px4_msgs::msg::dds_::PackStatus_", "/uav_1/fmu/out/pack_status", pack_status_s, 50.0, 0 },
{ ORB_ID(pack_status_backup), "px4_msgs::msg::dds_::PackStatus_", "/uav_1/fmu/out/pack_status_backup1", pack_status_s, 5, 1 },
case 0: fleet_status of px4_msgs::msg::FleetStatus, "/uav_1/fmu/in/fleet_status"

