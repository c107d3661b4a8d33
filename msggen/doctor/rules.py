"""The table of the rules of `doctor`, in the order in which they are looked at: a cause before its effects."""

from __future__ import annotations

from msggen.check.finding import Category
from msggen.doctor import connecting, naming, release, samples
from msggen.doctor.setpoint_rules import MEASUREMENT, SETPOINT, of_category

_link, _session, _name, _definition, _time, _flow = map(
    of_category, (Category.LINK, Category.SESSION, Category.NAME, Category.DEFINITION, Category.TIME, Category.FLOW)
)

DOCTOR = (
    _link(
        "PORT_TAKEN",
        "another process has the port or the serial device",
        connecting.find_taken,
        "End the process that the finding names, or use another port on both sides. The vehicle's port is the "
        "parameter UXRCE_DDS_PRT. A process of another user is only named to root.",
    ),
    _link(
        "AGENT_HAS_CLIENT",
        "a Micro XRCE-DDS agent has the vehicle",
        connecting.find_busy_agent,
        "Leave the agent as it is, and use `--link dds://0`. Or start the agent on another port and put a tap "
        "between: `--link tap://127.0.0.1:8888?agent=127.0.0.1:8889`. Or end the agent: msggen needs none.",
    ),
    _link(
        "AGENT_WITHOUT_CLIENT",
        "a Micro XRCE-DDS agent answers, but no vehicle is seen behind it",
        connecting.find_idle_agent,
        "Look at `uxrce_dds_client status` in PX4's shell: it must say that it runs, and show the address and the "
        "port of the agent. A vehicle on another computer is only seen over DDS, which needs the extra "
        "`dds` of msggen.",
    ),
    _link(
        "AGENT_MISSING",
        "a tap or DDS needs an agent, and none answers",
        connecting.find_no_agent,
        "Start the agent, such as `MicroXRCEAgent udp4 -p 8889` behind a tap. Without one, use `--link udp://`.",
    ),
    _link(
        "CLIENT_ELSEWHERE",
        "a PX4 or `msggen sim` on this computer sends to another port",
        connecting.find_elsewhere,
        "Use the port of the client in `--link`, or set UXRCE_DDS_PRT, in simulation PX4_UXRCE_DDS_PORT, to that "
        "of the link.",
    ),
    _link(
        "LINE_GARBLED",
        "a serial line has another speed or another protocol",
        connecting.find_garbled,
        "Give the speed of the vehicle's port, such as SER_TEL2_BAUD, in the address. Set MAV_1_CONFIG to 0 if "
        "MAVLink runs on the port.",
    ),
    _link(
        "NO_CLIENT",
        "no client sends anything to this link",
        connecting.find_no_client,
        "Start `uxrce_dds_client` on the vehicle with the address of this computer: parameters UXRCE_DDS_CFG, "
        "UXRCE_DDS_AG_IP and UXRCE_DDS_PRT, then restart PX4. Look at its status in PX4's shell. Open the port in the "
        "firewall of this computer.",
    ),
    _link(
        "CLIENT_REFUSED",
        "clients send, but their addresses are not allowed",
        connecting.find_refused,
        "Add the address to `--allow` if it is that of your vehicle.",
    ),
    _session(
        "NO_TIME_SYNC",
        "a client does not get the answers to its requests for the time",
        connecting.find_no_time,
        "Check that packets reach the vehicle: a firewall, a wrong route back, an agent behind the tap that does "
        "not answer. The client creates no topics before its clock is synchronized. With UXRCE_DDS_SYNCT at 0 it "
        "does, and its timestamps are times since boot.",
    ),
    _session(
        "CLIENT_UNREADY",
        "a client sends, but creates no topics",
        connecting.find_unready,
        "Run `msggen doctor` again after a few seconds: a client notices within 14 s that an earlier program has "
        "ended. If it stays so, packets to the vehicle get lost: check the firewall and the way back.",
    ),
    _session(
        "KEY_SHARED",
        "several clients have the same key",
        connecting.find_shared_key,
        "Set UXRCE_DDS_KEY to another number at each vehicle. An agent keeps one client for each key, so the "
        "clients take the session from each other.",
    ),
    _session(
        "KEY_WRONG",
        "no vehicle has the key that was asked for",
        connecting.find_wrong_key,
        "Use the key of the vehicle, its parameter UXRCE_DDS_KEY, or leave out `--key`.",
    ),
    _session(
        "ZENOH_LIMITED",
        "a vehicle on Zenoh has a firmware that tells too little, or samples that are not CDR",
        connecting.find_limited,
        "Update PX4 to v1.17 or later, and build it with CONFIG_ZENOH_RMW_LIVELINESS and "
        "CONFIG_ZENOH_KEY_TYPE_HASH, and with PX4_UXRCE_DDS_NS if there are several vehicles. Or use its "
        "uxrce_dds_client.",
    ),
    _session(
        "STACK_SMALL",
        "programs send large messages over Zenoh, for which PX4's module has a stack that is too small",
        connecting.find_small_stack,
        "Use the uxrce_dds_client of the vehicle for flight modes, or a firmware that has PX4 28306 in it.",
    ),
    _session(
        "VEHICLE_RESTARTS",
        "a vehicle begins session after session",
        connecting.find_restarts,
        "Look at PX4's console for the reason. A client restarts if four pings in a row get no answer, if a topic "
        "cannot be created, or if PX4 itself restarts.",
    ),
    _session(
        "VEHICLE_SILENT",
        "a vehicle was connected, and has stopped to send",
        connecting.find_silent,
        "Check the power of the vehicle and the line. In simulation, check that PX4 still runs.",
    ),
    _name(
        "NAMESPACE_WRONG",
        "the vehicle has another namespace",
        naming.find_namespace,
        "Use the names of the vehicle, `/uav_1/fmu/out/vehicle_status`, or give its client the expected "
        "namespace: `uxrce_dds_client start -n uav_1`, or PX4_UXRCE_DDS_NS in simulation. Simulations with several "
        "vehicles set one.",
    ),
    _name(
        "NAMESPACE_SHARED",
        "several vehicles have the same namespace, or none",
        naming.find_shared_namespace,
        "Give each client a namespace of its own: `uxrce_dds_client start -n uav_1`, the parameter "
        "UXRCE_DDS_NS_IDX where the firmware has it, or PX4_UXRCE_DDS_NS in simulation. Programs of msggen select a "
        "vehicle by its key, too; to look at one, give its `--key`.",
    ),
    _name(
        "VERSION_WRONG",
        "the topic of the vehicle has another version suffix",
        naming.find_version,
        "Since PX4 v1.16, the version of a message is at the end of the topic: `/fmu/out/vehicle_status_v1`. Use "
        "the name that the vehicle has, with the types of its firmware. PX4's translation node offers other versions "
        "to ROS 2. `convert=True` in `msggen.live` converts them.",
    ),
    _name(
        "TOPIC_NOT_BRIDGED",
        "a topic is not in the dds_topics.yaml of the firmware",
        naming.find_not_bridged,
        "Add the topic to dds_topics.yaml of the firmware, and build and flash it. Then build the types from that "
        "file. Without a new firmware, `listener TOPIC` in PX4's shell shows uORB topics.",
    ),
    _name(
        "TOPIC_UNKNOWN",
        "no uORB topic has the name",
        naming.find_unknown,
        "Correct the name. `msggen topic list` shows the topics of the vehicle.",
    ),
    _name(
        "TOPIC_UNPUBLISHED",
        "a topic that was asked for exists, and PX4 does not publish it",
        naming.find_unheard,
        "Some topics are published only when something happens, such as vehicle_command_ack, or need a sensor, a "
        "pilot or a mission. `listener TOPIC` in PX4's shell shows whether a module publishes it.",
    ),
    _name(
        "READER_RELIABLE",
        "a reader in DDS is RELIABLE, and PX4's writers are BEST_EFFORT",
        samples.find_reliable,
        "Ask for BEST_EFFORT: `qos_profile_sensor_data` in rclpy and rclcpp, `--qos-reliability best_effort` for "
        "`ros2 topic echo`.",
    ),
    _definition(
        "RELEASE_DIFFERS",
        "the vehicle has another release than the types",
        release.find_release,
        "Build the types of the vehicle's firmware: `msggen build --px4 v1.18`, and in ROS 2 check out px4_msgs "
        "in the branch of its release. Topics and definitions that differ are findings of other rules: `--verbose` and "
        "`--json` list them.",
    ),
    _definition(
        "TYPE_UNKNOWN",
        "the vehicle has a message that the types do not have",
        samples.find_unknown_types,
        "Build the types from the firmware of the vehicle: `msggen build --px4 PX4-Autopilot`, and give the "
        "package as `--types`. In ROS 2, run `msggen sync` and build px4_msgs again.",
    ),
    _definition(
        "DEFINITION_DIFFERS",
        "a message of the vehicle has another definition",
        samples.find_differing,
        "Build the types from the firmware of the vehicle: `msggen build --px4 PX4-Autopilot`. In ROS 2, check "
        "out px4_msgs in the branch of the firmware's release, or run `msggen sync`, and build the workspace again. "
        "`msggen check` shows the fields that differ.",
    ),
    _time(
        "TIME_NOT_SYNCED",
        "timestamps are times since boot, not UTC",
        samples.find_unsynchronised,
        "Set UXRCE_DDS_SYNCT to 1 and restart PX4. In simulation with a simulated clock, PX4 may have set it to "
        "0: use the simulation's clock in all programs then.",
    ),
    _time(
        "CLOCK_WRONG",
        "timestamps differ by more than a second from the clock of this computer",
        samples.find_wrong_clock,
        "Synchronize the clocks of all computers with chrony or systemd-timesyncd. The agent's clock is the one "
        "that the vehicle follows. Restart the client after a clock was set: it follows slowly.",
    ),
    _time(
        "CLOCK_UNSETTLED",
        "timestamps are wrong by 20 ms or more, because the vehicle's estimate of the clocks has not settled",
        samples.find_unsettled_clock,
        "Wait: PX4's estimate changes slowly, and can be wrong by 40 ms for minutes after the start. Or correct "
        "timestamps by `bridge_error` of `clock.TimeSync`, a part of the generated package. In a simulation that is "
        "slower than real time, the estimate lags behind, by 0.2 s at most: set UXRCE_DDS_SYNCT to 0 there, and use "
        "the simulation's clock in all programs.",
    ),
    _flow(
        "DATAGRAMS_DAMAGED",
        "datagrams arrive damaged, or are of another protocol",
        connecting.find_damaged,
        "Check the network, or the wires of a serial line. If another program sends to the port, such as MAVLink, "
        "give one of them another port. UXRCE_DDS_PRT is that of the vehicle's client.",
    ),
    _flow(
        "LINE_FULL",
        "a serial line carries fewer bytes than the vehicle sends",
        samples.find_full_line,
        "Raise the speed of the line on both sides, SER_TEL2_BAUD and `?baud=`. Or lower `rate_limit` of the "
        "costliest topics in dds_topics.yaml, or remove them from it.",
    ),
    _flow(
        "BUFFER_FULL",
        "the kernel dropped datagrams, because the receive buffer was full",
        samples.find_small_buffer,
        "Let the kernel grant larger buffers: `sudo sysctl net.core.rmem_max=4194304`, for good in "
        "`/etc/sysctl.d/60-msggen.conf`. If they are large already, other programs keep this computer busy.",
    ),
    _flow(
        "SAMPLES_LOST",
        "messages with samples did not arrive, 1 % of them or more",
        samples.find_lost,
        "On a network, use a cable, a better channel, or lower rates. On a serial line, check wires and ground. "
        "PX4 numbers the samples of all topics together, so it is not known which topics lost samples.",
    ),
    _flow(
        "RATE_LOW",
        "topics arrive at less than half of the rate that dds_topics.yaml allows",
        samples.find_slow,
        "Look at `uorb top` in PX4's shell, which shows how often a topic is published there. If that is the rate "
        "of the doctor, the vehicle's CPU is too slow, or a simulation runs slower than real time. If it is higher, "
        "the link is too slow. Only topics that PX4 publishes at 100 Hz and more are judged: those that were named, "
        "or most of them.",
    ),
    *MEASUREMENT,
    *SETPOINT,
)
"""The rules."""

LIVE = tuple(rule for rule in DOCTOR if rule.id in ("VERSION_WRONG", "TYPE_UNKNOWN", "DEFINITION_DIFFERS"))
"""The rules of `check --live`: the definitions."""
