// uint64 timestamp | float64[2] position | px4/PackStatus pack | uint64 timestamp | bool ready | px4/CellReport[3] cells | uint64 timestamp | float32 voltage | uint8 cell | char[5] label | px4/CellReport spare | uint64 timestamp | float32 voltage | uint8 cell
// nests: px4/PackStatus px4/CellReport px4/CellReport
ORB_DEFINE(fleet_status, 1, 1);

