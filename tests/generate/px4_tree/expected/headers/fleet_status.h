// px4/FleetStatus from msg/versioned/FleetStatus.msg: 3 fields, 104 bytes
#include <uORB/topics/pack_status.h>
#define FLEET_STATUS_MESSAGE_VERSION 2 // uint32
#define FLEET_STATUS_FACTOR 2 // float32
struct fleet_status_s {
	uint64 timestamp;
	float64 position[2];
	px4_PackStatus pack;
};
namespace px4::msg { using FleetStatus = fleet_status_s; }
ORB_DECLARE(fleet_status);

