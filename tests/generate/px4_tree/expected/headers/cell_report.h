// px4/CellReport from msg/CellReport.msg: 3 fields, 16 bytes
struct cell_report_s {
	uint64 timestamp;
	float32 voltage;
	uint8 cell;
	uint8 _padding[3];
};
namespace px4::msg { using CellReport = cell_report_s; }
ORB_DECLARE(cell_report);

