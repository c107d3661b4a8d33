typedef struct fleet_status_s px4_msgs_msg_FleetStatus;
// pack: PackStatus, read: True
/*
uint32 MESSAGE_VERSION = 2
uint64 timestamp
float64[2] position
PackStatus pack
float32 FACTOR = 2.5
*/
