"""The messages of the topics in a ULog that are not named after theirs."""

# by message: the `# TOPICS` lines of PX4's definitions
_OTHER_TOPICS = {
    "ActuatorControlsStatus": "actuator_controls_status_0 actuator_controls_status_1",
    "ActuatorOutputs": "actuator_outputs_sim actuator_outputs_debug",
    "ButtonEvent": "safety_button",
    "ConfigOverrides": "config_overrides_request config_overrides_confirm",
    "EstimatorAidSource1d": "estimator_aid_src_baro_hgt estimator_aid_src_ev_hgt estimator_aid_src_gnss_hgt "
    "estimator_aid_src_rng_hgt estimator_aid_src_ranging_beacon estimator_aid_src_airspeed estimator_aid_src_sideslip "
    "estimator_aid_src_fake_hgt estimator_aid_src_gnss_yaw estimator_aid_src_ev_yaw",
    "EstimatorAidSource2d": "estimator_aid_src_ev_pos estimator_aid_src_fake_pos estimator_aid_src_gnss_pos "
    "estimator_aid_src_aux_global_position estimator_aid_src_aux_vel estimator_aid_src_optical_flow "
    "estimator_aid_src_drag",
    "EstimatorAidSource3d": "estimator_aid_src_ev_vel estimator_aid_src_gnss_vel estimator_aid_src_gravity "
    "estimator_aid_src_mag",
    "EstimatorBias": "estimator_baro_bias estimator_gnss_hgt_bias",
    "EstimatorBias3d": "estimator_ev_pos_bias",
    "EstimatorInnovations": "estimator_innovation_variances estimator_innovation_test_ratios",
    "ManualControlSetpoint": "manual_control_input",
    "MavlinkTunnel": "esc_serial_passthru io_serial_passthru",
    "NormalizedUnsignedSetpoint": "flaps_setpoint spoilers_setpoint",
    "ObstacleDistance": "obstacle_distance_fused",
    "OrbTest": "orb_multitest",
    "OrbTestMedium": "orb_test_medium_multi orb_test_medium_wrap_around orb_test_medium_queue "
    "orb_test_medium_queue_poll",
    "ParameterSetValueRequest": "parameter_remote_set_value_request parameter_primary_set_value_request",
    "ParameterSetValueResponse": "parameter_remote_set_value_response parameter_primary_set_value_response",
    "RtcmData": "rtcm_corrections rtcm_moving_baseline",
    "SensorGps": "vehicle_gps_position",
    "SensorsStatus": "sensors_status_baro sensors_status_mag",
    "VehicleAngularVelocity": "vehicle_angular_velocity_groundtruth",
    "VehicleAttitude": "vehicle_attitude_groundtruth external_ins_attitude estimator_attitude",
    "VehicleAttitudeSetpoint": "mc_virtual_attitude_setpoint fw_virtual_attitude_setpoint",
    "VehicleCommand": "gimbal_v1_command vehicle_command_mode_executor",
    "VehicleGlobalPosition": "vehicle_global_position_groundtruth external_ins_global_position "
    "estimator_global_position",
    "VehicleLocalPosition": "vehicle_local_position_groundtruth external_ins_local_position estimator_local_position",
    "VehicleOdometry": "vehicle_mocap_odometry vehicle_visual_odometry estimator_odometry",
    "VehicleOpticalFlowVel": "estimator_optical_flow_vel",
    "VehicleThrustSetpoint": "vehicle_thrust_setpoint_virtual_fw vehicle_thrust_setpoint_virtual_mc",
    "VehicleTorqueSetpoint": "vehicle_torque_setpoint_virtual_fw vehicle_torque_setpoint_virtual_mc",
    "VteAidSource1d": "vte_aid_ev_yaw",
    "VteAidSource3d": "vte_aid_gps_pos_target vte_aid_gps_pos_mission vte_aid_gps_vel_target vte_aid_gps_vel_uav "
    "vte_aid_fiducial_marker",
    "Wind": "estimator_wind",
}
MESSAGES = {topic: message for message, topics in _OTHER_TOPICS.items() for topic in topics.split()}
"""The messages of topics that are not named after theirs."""
