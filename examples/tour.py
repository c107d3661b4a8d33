"""A first look at the generated package: a message, its bytes, its description, and its topics."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "generated"))

from px4_types import DecodeError, SensorCombined, topics

message = SensorCombined(timestamp=1, gyro_rad=(0.0, 0.1, 0.2))
sample = message.encode()
print(f"sample    {sample[:4].hex(' ')} | {sample[4:28].hex(' ')} ... {len(sample)} bytes")
print(f"decoded   {SensorCombined.decode(sample).gyro_rad}")
print(f"equal     {SensorCombined.decode(sample) == message}")

about = SensorCombined.__msg__
print(f"type      {about.ros_type}, message hash {about.message_hash:#010x}, {about.type_hash[:20]}...")
for field in about.fields[:2]:
    print(f"field     {field.name}: {field.type} [{field.unit}] at byte {field.offset}")

endpoint = topics.endpoint("/fmu/out/vehicle_status_v4")
print(
    f"endpoint  {endpoint.ros_name}: {endpoint.message.__name__}, id {endpoint.object_id}, {endpoint.rate_limit_hz} Hz"
)
print(f"qos       subscribe with {endpoint.qos.reader.reliability}, {endpoint.qos.reader.durability}")

try:
    SensorCombined.decode(sample[:40])
except DecodeError as error:
    print(f"error     {error}")
