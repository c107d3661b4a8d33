typedef struct pack_status_s px4_msgs_msg_PackStatus;
// cells: CellReport, read: True
// spare: CellReport, read: True
/*
# A pack of cells, nested and nested by FleetStatus.

uint64 timestamp    # [us] Time since boot.
bool ready
CellReport[3] cells
char[5] label
uint8 ORB_QUEUE_LENGTH = 4
int16 COLDEST = -40
bool BALANCES = True
CellReport spare
# TOPICS pack_status pack_status_backup
# TOPICS PackStatusThird
*/
