// 3 messages, 5 topics
enum class ORB_ID {
	cell_report = 0,
	fleet_status = 1,
	pack_status = 2,
	pack_status_backup = 3,
	pack_status_third = 4,
};
