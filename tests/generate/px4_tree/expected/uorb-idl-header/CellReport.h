typedef struct cell_report_s px4_msgs_msg_CellReport;
/*
# One cell.

uint64 timestamp    # [us] Time since boot.
float32 voltage     # [V]
uint8 cell
*/
