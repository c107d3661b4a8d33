// uint64 timestamp | float32 voltage | uint8 cell
// nests: 
ORB_DEFINE(cell_report, 0, 1);

