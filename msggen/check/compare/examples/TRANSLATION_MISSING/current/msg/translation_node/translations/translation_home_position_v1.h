#pragma once

#include <px4_msgs/msg/home_position.hpp>
#include <px4_msgs_old/msg/home_position_v0.hpp>

class HomePositionV1Translation {
public:
	using MessageOlder = px4_msgs_old::msg::HomePositionV0;
	using MessageNewer = px4_msgs::msg::HomePosition;

	static void fromOlder(const MessageOlder &older, MessageNewer &newer)
	{
		newer.timestamp = older.timestamp;
		newer.lat = older.lat;
		newer.lon = older.lon;
		newer.valid_lpos = true;
	}
};
