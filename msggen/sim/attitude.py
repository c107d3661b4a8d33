"""Rotations of a simulated vehicle: quaternions w, x, y, z from body axes to NED."""

from __future__ import annotations

import math
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]


def quaternion_of(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion of Euler angles."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def angles_of(q: Quaternion, near: float) -> tuple[float, float, float]:
    """Return the Euler angles of a quaternion, with its sign: roll within a quarter turn, yaw near an angle."""
    w, x, y, z = q
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - x * z))))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    if abs(roll) > math.pi / 2:
        roll, pitch = roll - math.copysign(math.pi, roll), math.remainder(math.pi - pitch, math.tau)
        yaw += math.pi
    yaw = near + math.remainder(yaw - near, math.tau)
    if sum(a * b for a, b in zip(quaternion_of(roll, pitch, yaw), q, strict=True)) < 0:
        yaw += math.tau
    return roll, pitch, yaw


def turned(q: Quaternion, rates: Vector, seconds: float) -> Quaternion:
    """Return a quaternion after a short time of angular velocity in body axes."""
    a, b, c = (rate * seconds / 2 for rate in rates)
    w, x, y, z = product(q, (1.0, a, b, c))
    size = math.sqrt(w * w + x * x + y * y + z * z)
    return w / size, x / size, y / size, z / size


def rates_to(q: Quaternion, goal: Quaternion, gain: float) -> Vector:
    """Return the angular velocity in body axes that leads to another attitude the short way."""
    w, x, y, z = product((q[0], -q[1], -q[2], -q[3]), goal)
    gain = math.copysign(2 * gain, w)
    return gain * x, gain * y, gain * z


def down_axis(q: Quaternion) -> Vector:
    """Return the body's z axis in NED."""
    w, x, y, z = q
    return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)


def to_body(q: Quaternion, vector: Vector) -> Vector:
    """Return a vector of NED in body axes."""
    w, x, y, z = q
    _, a, b, c = product(product((w, -x, -y, -z), (0.0, *vector)), q)
    return a, b, c


def from_body(q: Quaternion, vector: Vector) -> Vector:
    """Return a vector of body axes in NED."""
    w, x, y, z = q
    return to_body((w, -x, -y, -z), vector)


def added(one: Vector, other: Vector) -> Vector:
    """Return the sum of two vectors."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the rotation q followed by p."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )
