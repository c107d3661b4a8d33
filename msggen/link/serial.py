"""The link over a serial line: PX4's client on a telemetry port, or a pseudo terminal."""

from __future__ import annotations

import errno
import os
import selectors
import sys
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

from msggen.base.missing import installing
from msggen.link.age import LONGEST_S, NEVER
from msggen.link.age import now as now_ns
from msggen.link.agent_link import SelectorLink
from msggen.link.link import LinkError, Listener
from msggen.link.xrce.framing import Deframer, pack_frame
from msggen.link.xrce.outbox import Address

CHUNK = 65536
LEAST_KEPT = 4096
"""The bytes that may wait for a slow line, at least, besides messages that expire."""
RETRY = 1.0
"""The time in s between two attempts to open a device that was unplugged."""
_BITS = 10
"""The bits of a byte on the line: with one to start and one to stop."""
_REMEMBERED = 1024
"""The most frames that are remembered after they were written. The buffers of the system hold 4 kB."""
USUAL = 57600
"""The slowest speed that is offered in errors."""
SILENT_BYTES = 2000
"""The number of bytes without any intact frame that shows that something is wrong with the line."""


class SerialLink(SelectorLink):
    """A link to the vehicle at the other end of a serial line."""

    def __init__(
        self,
        path: str,
        baud: int = 921600,
        *,
        keys: Sequence[int] = (),
        records: str = "",
    ) -> None:
        """Make a link over a device, such as /dev/ttyUSB0, with a speed: that of PX4's parameter SER_TEL2_BAUD, say.

        `keys` and `records` as for AgentLink.
        """
        super().__init__(keys=keys, records=records)
        self.path = path
        self.baud = baud
        self._fd = -1
        self._deframer = Deframer()
        self._broken = 0
        """Frames with a wrong checksum before the device was opened the last time."""
        self._bytes = 0
        self._next_try = 0.0
        self._queue = LineQueue()
        self._unsent = self._expired = 0
        self._has_told_of_speed = self._has_told_of_space = False

    def open(self, listener: Listener) -> None:
        """Open the device."""
        super().open(listener)
        self.resources.callback(self._close_device)
        self._plug(open_line(self.path, self.baud))

    def is_settled(self) -> bool:
        """Return True: a line has one vehicle."""
        return True

    def _plug(self, fd: int) -> None:
        with self.lock:
            self._fd = fd
            self._broken += self._deframer.broken
            self._deframer = Deframer()
            self._bytes = 0
            self._queue = LineQueue()
            self.selector.register(fd, selectors.EVENT_READ, self._ready)

    def _unplug(self, listener: Listener) -> None:
        """Report the vehicle as disconnected, and try to open the device again from time to time."""
        with self.lock:
            self.selector.unregister(self._fd)
            close_line(self._fd)
            self._fd = -1
            self.agent.close(f"{self.path} was unplugged")
        self.flush(listener)
        listener.warned(f"{self.path} was unplugged: the link continues when it is there again")
        self._next_try = time.monotonic() + RETRY

    def _ready(self, events: int, listener: Listener) -> None:
        if events & selectors.EVENT_WRITE:
            with self.lock:
                self._write()
        if not events & selectors.EVENT_READ:
            return
        try:
            data = os.read(self._fd, CHUNK)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data = b""
        if not data:
            self._unplug(listener)
            return
        messages = self._deframer.feed(data)
        if messages:
            now = time.time_ns()
            with self.lock:
                for message in messages:
                    self.agent.receive(message, self.path, now)
            self.flush(listener)
        elif not self._deframer.frames and not self._has_told_of_speed:
            self._suspect(len(data), listener)

    def _suspect(self, size: int, listener: Listener) -> None:
        """Count bytes without a frame, and tell if they are many."""
        self._bytes += size
        if self._bytes > SILENT_BYTES:
            self._has_told_of_speed = True
            listener.warned(
                f"{self._bytes} bytes arrived from {self.path}, but no intact frame: check that {self.baud} baud is "
                "the speed of the vehicle's port (SER_TEL2_BAUD), and that uxrce_dds_client runs on it, not MAVLink"
            )

    def look(self, now: float, listener: Listener) -> None:
        """Open the device again if it was unplugged. Drop what has expired. Tell if it is too slow."""
        with self.lock:
            self._write()
        if (self._unsent or self.overdue or self._expired) and not self._has_told_of_space:
            self._has_told_of_space = True
            listener.warned(f"{self.path} is too slow for what is sent: samples to the vehicle were dropped")
        if self._fd < 0 and now >= self._next_try:
            self._next_try = now + RETRY
            with suppress(LinkError):
                self._plug(open_line(self.path, self.baud))

    def transmit(self, datagrams: list[tuple[bytes, Address]], until: int = NEVER) -> None:
        """Send messages. Drop those for which the line is too slow: they would arrive after they have expired."""
        if self._fd < 0:
            return
        for data, _ in datagrams:
            frame = pack_frame(data)
            ahead = self._queue.size + waiting_in(self._fd)
            arrival = now_ns() + (ahead + len(frame)) * _BITS * 1_000_000_000 // self.baud
            if until < NEVER and arrival > until:
                self.unsent += 1
                self.overdue += 1
            elif until == NEVER and ahead + len(frame) > max(LEAST_KEPT, int(self.baud / _BITS * LONGEST_S)):
                self._unsent += 1
            else:
                self._queue.add(frame, until)
                self.sent += 1
        self._write()

    def _write(self) -> None:
        """Write what waits, and watch for space if something is left. The caller holds the lock."""
        if self._fd < 0:
            return
        expired = self._queue.write(self._fd)
        self._expired += expired
        self.unsent += expired
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if self._queue.size else 0)
        if self.selector.get_key(self._fd).events != events:
            self.selector.modify(self._fd, events, self._ready)

    def name(self) -> str:
        """Return the device, by the name that it keeps."""
        return os.path.realpath(self.path)

    def dropped(self) -> int:
        """Return the number of frames with a wrong checksum, or that were cut."""
        return self._broken + self._deframer.broken

    def _close_device(self) -> None:
        if self._fd >= 0:
            close_line(self._fd)
            self._fd = -1


class Frame(NamedTuple):
    """A frame that waits for a line, and the time at which it expires."""

    data: bytes
    until: int


class LineQueue:
    """The frames that wait for a line, and those that were written and may still wait in the system."""

    def __init__(self) -> None:
        self.size = 0
        """The bytes that were not written yet."""
        self._frames: deque[Frame] = deque()
        self._begun = 0
        """The bytes of the first frame that were written."""
        self._written = 0
        """All bytes that were written, and the frames that expire with their ends among them, in order."""
        self._ends: deque[tuple[int, int]] = deque(maxlen=_REMEMBERED)
        self._earliest = NEVER
        """The earliest time at which one of them expires."""

    def add(self, data: bytes, until: int) -> None:
        """Add a frame."""
        self._frames.append(Frame(data, until))
        self.size += len(data)

    def write(self, fd: int) -> int:
        """Write as much as the device takes, but nothing that has expired. Return how many frames have."""
        dropped = self._flush(fd)
        with suppress(OSError):  # no space now; or the device is gone, which reading tells
            while self._frames:
                frame = self._frames[0]
                if now_ns() > frame.until:  # the next frame ends one that was begun: the receiver drops that
                    dropped += 1
                    self._next()
                    continue
                count = os.write(fd, frame.data[self._begun :])
                self._begun += count
                self._written += count
                self.size -= count
                if self._begun == len(frame.data):
                    if frame.until < NEVER:
                        self._ends.append((self._written, frame.until))
                        self._earliest = min(self._earliest, frame.until)
                    self._next()
        return dropped

    def _next(self) -> None:
        self.size -= len(self._frames.popleft().data) - self._begun
        self._begun = 0

    def _flush(self, fd: int) -> int:
        """Let the system forget what it has not sent, if a frame in it has expired. Return how many frames that are."""
        now = now_ns()
        if now <= self._earliest:
            return 0
        sent = self._written - waiting_in(fd)
        while self._ends and self._ends[0][0] <= sent:
            self._ends.popleft()
        self._earliest = min((until for _, until in self._ends), default=NEVER)
        if now <= self._earliest:
            return 0
        discard(fd)
        dropped = len(self._ends)
        self._ends.clear()
        self._earliest = NEVER
        return dropped


def waiting_in(fd: int) -> int:
    """Return the bytes that were written to a device and wait in the system, 0 if that is not known."""
    import fcntl
    import termios

    with suppress(OSError):
        return int.from_bytes(fcntl.ioctl(fd, termios.TIOCOUTQ, bytes(4)), sys.byteorder)
    return 0


def discard(fd: int) -> None:
    """Forget what was written to a device and was not sent."""
    import termios

    with suppress(OSError, termios.error):
        termios.tcflush(fd, termios.TCOFLUSH)


def close_line(fd: int) -> None:
    """Close a serial device, and let others open it, also if this is not its last file descriptor.

    What was not sent is discarded: the system would wait for it, up to 30 s.
    """
    import fcntl
    import termios

    discard(fd)
    with suppress(OSError):  # it is unplugged
        fcntl.ioctl(fd, termios.TIOCNXCL)
    os.close(fd)


def open_line(path: str, baud: int) -> int:
    """Return a file descriptor of a serial device: raw, eight bits, no parity, no flow control, and nobody else's.

    Raises LinkError.
    """
    if sys.platform == "win32":
        raise LinkError("serial lines need Linux or macOS: on Windows, use WSL, or UDP")
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise LinkError(_why(error, path)) from error
    try:
        _set_up(fd, path, baud)
    except BaseException:
        os.close(fd)
        raise
    return fd


def _why(error: OSError, path: str) -> str:
    """Return why a device cannot be opened, and what to do."""
    if error.errno in {errno.ENOENT, errno.ENODEV, errno.ENXIO}:
        return f"there is no device {path}: is it plugged in? `ls /dev/serial/by-id` lists the serial devices"
    if error.errno == errno.EBUSY:
        return _busy(path)
    if error.errno in {errno.EACCES, errno.EPERM}:
        return (
            f"no permission for {path}: join the group that owns it, `sudo usermod -aG dialout $USER`, and log in again"
        )
    return f"cannot open {path}: {error.strerror}"


def _busy(path: str) -> str:
    return (
        f"{path} is in use by another program, such as MicroXRCEAgent, QGroundControl or ModemManager: stop it; "
        f"`fuser -v {path}` shows it"
    )


def _set_up(fd: int, path: str, baud: int) -> None:
    import fcntl
    import termios

    if not os.isatty(fd):
        raise LinkError(f"{path} is not a serial device")
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)  # keeps programs away that lock devices, too
    except BlockingIOError as error:
        raise LinkError(_busy(path)) from error
    speed = getattr(termios, f"B{baud}", None) if baud > 0 else None
    if speed is None:
        _set_up_with_pyserial(path, baud)
    else:
        characters = termios.tcgetattr(fd)[6]
        characters[termios.VMIN], characters[termios.VTIME] = 1, 0
        control = termios.CS8 | termios.CREAD | termios.CLOCAL
        termios.tcsetattr(fd, termios.TCSANOW, [0, 0, control, 0, speed, speed, characters])
    fcntl.ioctl(fd, termios.TIOCEXCL)  # keeps all others away, except root's
    termios.tcflush(fd, termios.TCIOFLUSH)


def _set_up_with_pyserial(path: str, baud: int) -> None:
    """Set a speed that termios has no name for. The device keeps it as long as it is open."""
    import termios

    names = [name[1:] for name in dir(termios) if name[0] == "B" and name[1:].isdigit()]
    speeds = ", ".join(map(str, sorted(speed for name in names if (speed := int(name)) >= USUAL)))
    try:
        from serial import Serial, SerialException
    except ImportError as error:
        raise LinkError(
            f"{baud} baud needs the package pyserial: {installing('serial')}. Speeds without it: {speeds}"
        ) from error
    try:
        Serial(path, baud, timeout=0, inter_byte_timeout=0.1).close()
    except (SerialException, ValueError, OverflowError) as error:
        raise LinkError(f"{path} cannot do {baud} baud: use one of {speeds}") from error
