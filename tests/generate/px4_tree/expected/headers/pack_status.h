// px4/PackStatus from msg/PackStatus.msg: 5 fields, 80 bytes
#include <uORB/topics/cell_report.h>
#include <uORB/topics/cell_report.h>
#define PACK_STATUS_ORB_QUEUE_LENGTH 4 // uint8
#define PACK_STATUS_COLDEST -40 // int16
#define PACK_STATUS_BALANCES 1 // bool
struct pack_status_s {
	uint64 timestamp;
	bool ready;
	char label[5];
	px4_CellReport cells[3];
	px4_CellReport spare;
	uint8 _padding[2];
};
namespace px4::msg { using PackStatus = pack_status_s; }
ORB_DECLARE(pack_status);
ORB_DECLARE(pack_status_backup);
ORB_DECLARE(pack_status_third);

