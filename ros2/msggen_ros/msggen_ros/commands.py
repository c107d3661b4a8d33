"""Commands of msggen as programs of ROS. What follows `--ros-args` is for rclpy, which reads it from `sys.argv`."""

import sys

from msggen.cli import main


def relay() -> int:
    """Run `msggen relay`, and return its exit code."""
    return main(["relay", *own_words(sys.argv[1:])])


def doctor() -> int:
    """Run `msggen doctor`, and return its exit code."""
    return main(["doctor", *own_words(sys.argv[1:])])


def own_words(words: list[str]) -> list[str]:
    """Return the arguments in front of `--ros-args`."""
    return words[: words.index("--ros-args")] if "--ros-args" in words else words
