"""Tests of the topics that a user chooses: every name of a topic, patterns, and what is left out."""

from __future__ import annotations

from typing import Any

import pytest

from msggen.recordings.topics.choice import Choice

STATUS = ("/uav_1/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus")
ODOMETRY = ("/uav_1/fmu/out/vehicle_odometry", "px4_msgs/msg/VehicleOdometry")


@pytest.mark.parametrize(
    "name",
    [
        "/uav_1/fmu/out/vehicle_status_v4",
        "/uav_1/fmu/out/vehicle_status",
        "/fmu/out/vehicle_status_v4",
        "fmu/out/vehicle_status",
        "vehicle_status_v4",
        "vehicle_status",
        "VehicleStatus",
        "px4_msgs/msg/VehicleStatus",
        "vehicle_stat*",
        "*status*",
        "/uav_?/*/vehicle_status*",
    ],
)
def test_a_topic_has_many_names(name: str) -> None:
    assert [Choice([name]).takes(*topic) for topic in (STATUS, ODOMETRY)] == [True, False]
    assert [Choice((), [name]).takes(*topic) for topic in (STATUS, ODOMETRY)] == [False, True]


def test_all_topics_are_taken_without_names_and_excluded_ones_never() -> None:
    assert Choice().takes(*STATUS)
    assert not Choice(["vehicle_*"], ["VehicleStatus"]).takes(*STATUS)
    assert Choice(["vehicle_*"], ["VehicleStatus"]).takes(*ODOMETRY)


@pytest.mark.parametrize("name", ["status", "vehicle", "/vehicle_status_v3", "Vehicle_Status", ""])
def test_other_names_are_no_topics(name: str) -> None:
    assert not Choice([name]).takes(*STATUS)


def test_a_name_that_no_topic_has_is_told_with_the_nearest_one() -> None:
    assert Choice(["vehicle_odometry"], ["*status*"]).problem([STATUS, ODOMETRY]) == ""
    text = "no topic is called 'vehicle_odometri', did you mean 'vehicle_odometry'?"
    assert Choice(["vehicle_odometri"]).problem([STATUS, ODOMETRY]) == text
    assert Choice((), ["vehicle_odometri"]).problem([STATUS, ODOMETRY]) == text
    assert Choice(["battery*"]).problem([STATUS]) == "no topic is called 'battery*'"


def test_every_topic_of_a_release_is_found_by_its_uorb_name(px4_types: Any) -> None:
    topics = [(each.ros_name, each.message.__msg__.ros_type) for each in px4_types.topics.out]
    for each in px4_types.topics.out:
        taken = [name for name, ros_type in topics if Choice([each.uorb_topic]).takes(name, ros_type)]
        assert taken == [each.ros_name]
