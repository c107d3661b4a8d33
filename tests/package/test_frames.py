"""Tests of the conversions between the frames of PX4 and ROS, against the guide's definitions and scipy's rotations.

The guide defines each pair of frames by turns about the axes, and scipy's `Rotation` makes these. The conversions of
quaternions and covariances are compared with what they mean for vectors, so no formula is written twice.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

COUNT = 2_500
EXACT = 1e-12
NAN = math.nan


@pytest.fixture(scope="module")
def frames(px4_types: Any) -> Any:
    return px4_types.frames


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(14)


def guide(axes: str, degrees: list[float]) -> Any:
    """Return what turning the axes does to the components of a vector: each turn is about an axis that has turned."""
    return Rotation.from_euler(axes, degrees, degrees=True).inv()


GUIDE = {
    "ned_to_enu": guide("ZX", [90, 180]),  # about z (down), then about x (the old north, the new east)
    "enu_to_ned": guide("ZX", [90, 180]),  # about z (up), then about x (the old east, the new north)
    "frd_to_flu": guide("X", [180]),
    "flu_to_frd": guide("X", [180]),
}
"""The steps of PX4's ROS 2 user guide, "ROS 2 & PX4 Frame Conventions"."""

INVERSE = {
    "ned_to_enu": "enu_to_ned",
    "frd_to_flu": "flu_to_frd",
    "ned_to_enu_orientation": "enu_to_ned_orientation",
    "frd_to_flu_orientation": "flu_to_frd_orientation",
    "px4_to_ros_orientation": "ros_to_px4_orientation",
    "local_frd_to_flu_orientation": "local_frd_to_flu_orientation",
    "ned_to_enu_covariance": "enu_to_ned_covariance",
    "frd_to_flu_covariance": "flu_to_frd_covariance",
    "px4_to_ros_covariance": "ros_to_px4_covariance",
    "ned_to_enu_variances": "enu_to_ned_variances",
    "ned_to_enu_heading": "enu_to_ned_heading",
    "from_triangle": "to_triangle",
}
BOTH_WAYS = [
    *INVERSE.items(),
    *((back, there) for there, back in INVERSE.items() if there not in (back, "from_triangle")),
]
ORIENTATIONS = [name for name, _ in BOTH_WAYS if name.endswith("orientation")]
COVARIANCES = [name for name, _ in BOTH_WAYS if name.endswith("covariance")]


def quaternions(random: np.random.Generator) -> Any:
    return Rotation.random(COUNT, random_state=random).as_quat()[:, [3, 0, 1, 2]]


def rotation(quaternions: Any) -> Any:
    """Return the rotation of quaternions with w first."""
    return Rotation.from_quat(np.asarray(quaternions)[..., [1, 2, 3, 0]])


def covariances(random: np.random.Generator, size: int) -> Any:
    factors = random.normal(size=(COUNT, size, size))
    full = factors @ factors.transpose(0, 2, 1)
    return (full + full.transpose(0, 2, 1)) / 2


def samples(name: str, random: np.random.Generator) -> Any:
    """Return random arguments for a function."""
    if name.endswith("orientation"):
        return quaternions(random)
    if name.endswith("covariance"):
        return covariances(random, 6)
    if name.endswith("heading"):
        return random.uniform(-math.pi, math.pi, COUNT)
    if name == "from_triangle":
        return random.normal(size=(COUNT, 21))
    return random.normal(size=(COUNT, 3)) * 1000


def difference(one: Any, other: Any) -> float:
    """Return the largest difference between two arrays. `approx` is slow for many values."""
    return float(np.abs(np.asarray(one) - np.asarray(other)).max())


# --- Vectors and angular rates


@pytest.mark.parametrize("name", GUIDE)
def test_vectors_turn_as_the_guide_says(frames: Any, random: np.random.Generator, name: str) -> None:
    vectors = samples(name, random)
    assert difference(getattr(frames, name)(vectors), GUIDE[name].apply(vectors)) < 1e-9


NUMBERS = st.floats(-1e6, 1e6)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)


@pytest.mark.parametrize("name", GUIDE)
@given(one=VECTORS, other=VECTORS)
def test_the_conversion_of_a_vector_is_a_rotation(
    frames: Any, name: str, one: tuple[float, ...], other: tuple[float, ...]
) -> None:
    """Products and cross products are kept. A reflection, such as exchanging two axes only, changes cross products."""
    convert = getattr(frames, name)
    assert np.dot(convert(one), convert(other)) == pytest.approx(np.dot(one, other), abs=1e-3)
    assert np.cross(convert(one), convert(other)) == pytest.approx(convert(np.cross(one, other)), abs=1e-3)


def test_the_directions_have_their_names(frames: Any) -> None:
    assert frames.ned_to_enu((1.0, 0.0, 0.0)) == (0.0, 1.0, 0.0)  # north
    assert frames.ned_to_enu((0.0, 1.0, 0.0)) == (1.0, 0.0, 0.0)  # east
    assert frames.ned_to_enu((0.0, 0.0, 1.0)) == (0.0, 0.0, -1.0)  # down
    assert frames.frd_to_flu((1.0, 2.0, 3.0)) == (1.0, -2.0, -3.0)
    assert repr(frames.ned_to_enu((0.0, 0.0, 0.0))) == "(0.0, 0.0, 0.0)"


def test_angular_rates_turn_as_the_attitude_does(frames: Any, random: np.random.Generator) -> None:
    """An attitude that turns by a rate, converted, is the converted attitude that turns by the converted rate."""
    attitude, rates = rotation(quaternions(random)), random.normal(size=(COUNT, 3))
    later = attitude * Rotation.from_rotvec(rates)
    converted = [rotation(frames.px4_to_ros_orientation(each.as_quat()[:, [3, 0, 1, 2]])) for each in (attitude, later)]
    between = (converted[0].inv() * converted[1]).as_matrix()
    assert difference(between, Rotation.from_rotvec(frames.frd_to_flu(rates)).as_matrix()) < 1e-9


# --- Orientations


@pytest.mark.parametrize(
    ("name", "body", "local"),
    [
        ("px4_to_ros_orientation", "flu_to_frd", "ned_to_enu"),
        ("ros_to_px4_orientation", "frd_to_flu", "enu_to_ned"),
        ("local_frd_to_flu_orientation", "flu_to_frd", "frd_to_flu"),
        ("ned_to_enu_orientation", None, "ned_to_enu"),
        ("enu_to_ned_orientation", None, "enu_to_ned"),
        ("frd_to_flu_orientation", "flu_to_frd", None),
        ("flu_to_frd_orientation", "frd_to_flu", None),
    ],
)
def test_a_converted_orientation_turns_converted_vectors(
    frames: Any, random: np.random.Generator, name: str, body: str | None, local: str | None
) -> None:
    given, vectors = quaternions(random), random.normal(size=(COUNT, 3))
    unchanged: Callable[[Any], Any] = lambda values: values  # noqa: E731
    to_old_body, to_new_local = (getattr(frames, each) if each else unchanged for each in (body, local))
    converted = rotation(getattr(frames, name)(given)).apply(vectors)
    assert difference(converted, to_new_local(rotation(given).apply(to_old_body(vectors)))) < 1e-9


def test_orientations_are_the_products_of_the_guide(frames: Any, random: np.random.Generator) -> None:
    """The two steps of the guide as rotations of scipy: first the local frame, then the body."""
    given = quaternions(random)
    steps = GUIDE["ned_to_enu"] * rotation(given) * GUIDE["frd_to_flu"].inv()
    assert difference(rotation(frames.px4_to_ros_orientation(given)).as_matrix(), steps.as_matrix()) < 1e-9
    by_step = frames.frd_to_flu_orientation(frames.ned_to_enu_orientation(given))
    assert difference(frames.px4_to_ros_orientation(given), by_step) < EXACT


def test_level_and_facing_north_is_a_yaw_of_a_quarter_turn(frames: Any) -> None:
    w, x, y, z = frames.px4_to_ros_orientation((1.0, 0.0, 0.0, 0.0))
    assert (w, x, y, z) == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)))


@pytest.mark.parametrize("name", ORIENTATIONS)
@pytest.mark.parametrize(
    ("quaternion", "norm"),
    [((0, 0, 0, 0), "0"), ((1, 1, 0, 0), "1.414"), ((0.99, 0, 0, 0), "0.99"), ((math.inf, 0, 0, 0), "inf")],
)
def test_a_quaternion_that_is_no_rotation_is_an_error(frames: Any, name: str, quaternion: Any, norm: str) -> None:
    convert = getattr(frames, name)
    with pytest.raises(frames.FrameError, match=rf"^the quaternion is no rotation: its norm is {norm}, expected 1$"):
        convert(quaternion)
    with pytest.raises(frames.FrameError, match=rf"^quaternion 1 is no rotation: its norm is {norm}, expected 1$"):
        convert(np.array([(1, 0, 0, 0), quaternion]))
    with pytest.raises(frames.FrameError, match=r"^quaternion \(0, 1\) is no rotation"):
        convert(np.array([[(1, 0, 0, 0), quaternion]]))


@pytest.mark.parametrize("name", ORIENTATIONS)
def test_rounding_to_float32_leaves_a_rotation(frames: Any, random: np.random.Generator, name: str) -> None:
    given = quaternions(random).astype(np.float32)
    converted = getattr(frames, name)(given)
    assert converted.dtype == np.float64
    assert converted[7].tolist() == list(getattr(frames, name)(tuple(given[7].tolist())))


# --- Headings


def test_a_heading_is_the_direction_of_its_vector(frames: Any, random: np.random.Generator) -> None:
    headings = random.uniform(-10, 10, COUNT)
    north, east = np.cos(headings), np.sin(headings)
    enu = frames.ned_to_enu(np.stack([north, east, np.zeros(COUNT)], axis=-1))
    converted = frames.ned_to_enu_heading(headings)
    assert difference(np.cos(converted), enu[:, 0]) < EXACT
    assert difference(np.sin(converted), enu[:, 1]) < EXACT
    assert (converted > -math.pi).all()
    assert (converted <= math.pi).all()


def test_a_heading_is_the_yaw_of_the_attitude(frames: Any, random: np.random.Generator) -> None:
    """Yaw in NED and yaw in ENU are converted as headings, whatever roll and pitch are."""
    angles = random.uniform((-3, -1.5, -3), (3, 1.5, 3), (COUNT, 3))
    attitude = Rotation.from_euler("xyz", angles).as_quat()[:, [3, 0, 1, 2]]
    yaw = rotation(frames.px4_to_ros_orientation(attitude)).as_euler("xyz")[:, 2]
    turn = np.exp(1j * (yaw - frames.ned_to_enu_heading(angles[:, 2])))
    assert difference(turn, 1) < 1e-9


@pytest.mark.parametrize(
    ("heading", "expected"), [(0.0, math.pi / 2), (math.pi / 2, 0.0), (math.pi, -math.pi / 2), (-math.pi / 2, math.pi)]
)
def test_known_headings(frames: Any, heading: float, expected: float) -> None:
    assert frames.ned_to_enu_heading(heading) == expected
    assert frames.enu_to_ned_heading(expected) == heading


# --- Covariances


@pytest.mark.parametrize(
    ("name", "size"), [(name, size) for name in COVARIANCES for size in (3, 6) if size == 6 or "px4" not in name]
)
def test_a_covariance_is_that_of_converted_vectors(
    frames: Any, random: np.random.Generator, name: str, size: int
) -> None:
    """A covariance is M Mᵀ, and the converted one is that of the converted columns of M."""
    if "px4" in name:
        halves = (frames.ned_to_enu, frames.frd_to_flu)
    else:
        halves = (getattr(frames, name.removesuffix("_covariance")),) * 2
    columns = random.normal(size=(COUNT, size, size))
    parts = [half(columns[..., 3 * n : 3 * n + 3]) for n, half in enumerate(halves[: size // 3])]
    turned = np.concatenate(parts, axis=-1)
    covariance, expected = (each.transpose(0, 2, 1) @ each for each in (columns, turned))
    assert difference(getattr(frames, name)(covariance), expected) < 1e-9


def test_variances_are_the_diagonal_of_a_covariance(frames: Any, random: np.random.Generator) -> None:
    full = covariances(random, 3)
    diagonal = np.einsum("nii->ni", full)
    assert (frames.ned_to_enu_variances(diagonal) == np.einsum("nii->ni", frames.ned_to_enu_covariance(full))).all()
    assert (diagonal == np.einsum("nii->ni", frames.frd_to_flu_covariance(full))).all()


@pytest.mark.parametrize("size", [3, 6])
def test_flat_values_and_rows_are_the_same_covariance(frames: Any, random: np.random.Generator, size: int) -> None:
    full = covariances(random, size)
    flat = full.reshape(COUNT, size * size)
    converted = frames.ned_to_enu_covariance(full)
    assert (frames.ned_to_enu_covariance(flat) == converted.reshape(COUNT, size * size)).all()
    assert frames.ned_to_enu_covariance(full[0].tolist()) == tuple(map(tuple, converted[0].tolist()))
    assert frames.ned_to_enu_covariance(flat[0].tolist()) == tuple(converted[0].ravel().tolist())


@pytest.mark.parametrize("size", [3, 6])
def test_a_triangle_is_the_upper_one(frames: Any, random: np.random.Generator, size: int) -> None:
    full = covariances(random, size)
    upper = full[(slice(None), *np.triu_indices(size))]
    assert (frames.to_triangle(full) == upper).all()
    assert (frames.from_triangle(upper) == full).all()
    assert frames.to_triangle(full[0].tolist()) == tuple(upper[0].tolist())
    assert frames.from_triangle(upper[0].tolist()) == tuple(map(tuple, full[0].tolist()))


@pytest.mark.parametrize("name", [*COVARIANCES, "to_triangle"])
def test_a_covariance_that_is_not_symmetric_is_an_error(frames: Any, name: str) -> None:
    convert, wrong = getattr(frames, name), np.eye(6)
    wrong[1, 4] = 0.5
    text = r"is not symmetric: \[1\]\[4\] is 0.5 and \[4\]\[1\] is 0$"
    for form in (wrong, wrong.ravel(), wrong.tolist(), tuple(wrong.ravel().tolist())):
        with pytest.raises(frames.FrameError, match=rf"^the covariance {text}"):
            convert(form)
    with pytest.raises(frames.FrameError, match=rf"^covariance 1 {text}"):
        convert(np.array([np.eye(6), wrong]))
    wrong[1, 4] = NAN
    for form in (wrong, wrong.tolist()):
        with pytest.raises(frames.FrameError, match="is not symmetric"):
            convert(form)


@pytest.mark.parametrize("name", [*COVARIANCES, "to_triangle"])
@pytest.mark.parametrize("value", [NAN, math.inf])
def test_a_symmetric_covariance_may_be_unknown_or_rounded(frames: Any, name: str, value: float) -> None:
    convert, covariance = getattr(frames, name), np.eye(6)
    covariance[1, 4] = covariance[4, 1] = value
    covariance[0, 2], covariance[2, 0] = 0.1, np.float32(0.1)
    for form in (covariance, covariance.tolist()):
        assert not np.isfinite(np.asarray(convert(form))).all()
    assert np.isnan(convert(np.full((6, 6), NAN))).all()


# --- All functions


@pytest.mark.parametrize(("name", "back"), BOTH_WAYS)
def test_round_trips_are_exact(frames: Any, random: np.random.Generator, name: str, back: str) -> None:
    values = samples(name, random)
    returned = getattr(frames, back)(getattr(frames, name)(values))
    assert difference(returned, values) <= EXACT


@pytest.mark.parametrize("name", sorted({name for pair in BOTH_WAYS for name in pair}))
def test_a_batch_equals_its_samples(frames: Any, random: np.random.Generator, name: str) -> None:
    convert = getattr(frames, name)
    values = samples(name.replace("to_triangle", "covariance"), random)
    given = values.copy()
    batch = convert(values)
    single = [convert(value) for value in values.tolist()]
    assert (batch == np.array(single)).all()
    assert (values == given).all()
    grid = values.reshape(50, 50, *values.shape[1:])
    assert (convert(grid) == batch.reshape(50, 50, *batch.shape[1:])).all()


@pytest.mark.parametrize(
    "name", sorted({name for pair in BOTH_WAYS for name in pair} - {"from_triangle", "to_triangle"})
)
def test_nan_stays_nan(frames: Any, random: np.random.Generator, name: str) -> None:
    convert, value = getattr(frames, name), samples(name, random)[0]
    unknown = np.full_like(value, NAN)
    assert np.isnan(convert(unknown)).all()
    assert np.isnan(np.asarray(convert(unknown.tolist()))).all()


def test_a_component_that_is_nan_does_not_spread(frames: Any) -> None:
    east, north, up = frames.ned_to_enu((NAN, 2.0, 3.0))
    assert (east, up) == (2.0, -3.0)
    assert math.isnan(north)


@pytest.mark.parametrize("type_", ["<f4", ">f4", "f8", "f2"])
def test_vectors_keep_their_type(frames: Any, type_: str) -> None:
    values = np.array([(1, 2, 3)], type_)
    for name in ("ned_to_enu", "frd_to_flu", "ned_to_enu_variances"):
        converted = getattr(frames, name)(values)
        assert converted.dtype == values.dtype.newbyteorder("=")
        assert np.abs(converted).sum() == 6


def test_integers_become_floats(frames: Any) -> None:
    assert frames.ned_to_enu(np.array([1, 2, 3], np.uint8)).tolist() == [2.0, 1.0, -3.0]
    assert frames.ned_to_enu_covariance(np.eye(3, dtype=np.uint8)).dtype == np.float64


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("ned_to_enu", (1, 2), "expected 3 numbers, got 2"),
        ("frd_to_flu", np.zeros((3, 4)), r"expected 3 numbers, got an array of shape \(3, 4\)"),
        ("frd_to_flu", [(1, 2, 3)] * 3, "expected 3 numbers, got 3 x 3"),
        ("ned_to_enu", 1.0, "expected 3 numbers, got an object of type float"),
        ("ned_to_enu", np.float64(1), r"expected 3 numbers, got an array of shape \(\)"),
        ("ned_to_enu", "abc", "expected 3 numbers, got an object of type str"),
        ("ned_to_enu_variances", {1, 2, 3}, "expected 3 numbers, got an object of type set"),
        ("px4_to_ros_orientation", (1, 0, 0), "expected 4 numbers, got 3"),
        ("ned_to_enu_covariance", (1,) * 6, "expected a covariance of 3 x 3 or 9 or 6 x 6 or 36 values, got 6"),
        ("px4_to_ros_covariance", (1,) * 9, "expected a covariance of 6 x 6 or 36 values, got 9"),
        ("ned_to_enu_covariance", [(1, 2, 3), (2, 3), (3,)], "values, got an object of type list"),
        ("from_triangle", (1,) * 9, "expected the 6 or 21 values of an upper triangle, got 9"),
    ],
)
def test_a_value_of_another_kind_is_an_error(frames: Any, name: str, value: Any, text: str) -> None:
    with pytest.raises(frames.FrameError, match=f"{text}$"):
        getattr(frames, name)(value)
