#include <uORB/topics/cell_report.h>
#include <uORB/topics/fleet_status.h>
#include <uORB/topics/pack_status.h>
// namespace 'uav_1'
{ ORB_ID(pack_status), "px4_msgs::msg::dds_::PackStatus_", "/uav_1/fmu/out/pack_status", pack_status_s, 50.0, 20, 0 },
{ ORB_ID(pack_status_backup), "px4_msgs::msg::dds_::PackStatus_", "/uav_1/fmu/out/pack_status_backup1", pack_status_s, 5, 200, 1 },
{ ORB_ID(cell_report), "px4_msgs::msg::dds_::CellReport_", "/uav_1/fmu/out/cell_report", cell_report_s, 60, 17, 0 },
{ ORB_ID(cell_report), "px4_msgs::msg::dds_::CellReport_", "/uav_1/fmu/out/cell_report2", cell_report_s, False, 0, 2 },
{ ORB_ID(cell_report), "px4_msgs::msg::dds_::CellReport_", "/uav_1/fmu/out/cell_report3", cell_report_s,  Unlimited , 0, 3 },
{ ORB_ID(cell_report), "px4_msgs::msg::dds_::CellReport_", "/uav_1/fmu/out/cell_report4", cell_report_s, -1, 0, 4 },
{ ORB_ID(cell_report), "px4_msgs::msg::dds_::CellReport_", "/uav_1/fmu/out/cell_report5", cell_report_s, 5000, 1, 5 },
{ ORB_ID(cell_report), "px4_msgs::msg::dds_::CellReport_", "/uav_1/fmu/out/cell_report6", cell_report_s, 0, DEFAULT, 6 },
case 0: fleet_status of px4_msgs::msg::FleetStatus, "/uav_1/fmu/in/fleet_status", by '', depth 2
case 1: cell_report of px4_msgs::msg::CellReport, "/uav_1/fmu/in/cell_report", by 'index', depth 4

