// uint64 timestamp | bool ready | px4/CellReport[3] cells | uint64 timestamp | float32 voltage | uint8 cell | char[5] label | px4/CellReport spare | uint64 timestamp | float32 voltage | uint8 cell
// nests: px4/CellReport px4/CellReport
ORB_DEFINE(pack_status, 2, 4);
ORB_DEFINE(pack_status_backup, 3, 4);
ORB_DEFINE(pack_status_third, 4, 4);

