"""Reading of input files: regular files only, up to a limit, so that no input can block a run or fill the memory."""

import errno
import os
import stat

LARGEST = 2**24
"""Maximum number of bytes of an input file. The largest inputs of a firmware tree have some 10 kB."""

TOO_LARGE = f"larger than {LARGEST // 2**20} MiB, the limit for a file"

_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
_CHUNK = 2**16


def read_bytes(path: str, *, follow: bool = True) -> bytes:
    """Return the contents of a regular file. Raises OSError for anything else, and for more than `LARGEST` bytes.

    With `follow` unset, a symbolic link is refused too.
    """
    handle = os.open(path, _FLAGS if follow else _FLAGS | _NO_LINK)  # without waiting for the other end of a pipe
    try:
        mode = os.fstat(handle).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, "not a regular file", path)
        parts = [os.read(handle, _CHUNK)]
        while parts[-1] and len(parts) <= LARGEST // _CHUNK + 1:
            parts.append(os.read(handle, _CHUNK))
    finally:
        os.close(handle)
    data = b"".join(parts)
    if len(data) > LARGEST:
        raise OSError(errno.EFBIG, TOO_LARGE, path)
    return data


def read_text(path: str, errors: str = "strict") -> str:
    """Return the text of a UTF-8 file with LF at the ends of lines, without a byte order mark.

    Raises OSError and UnicodeDecodeError.
    """
    return read_bytes(path).decode("utf-8-sig", errors).replace("\r\n", "\n").replace("\r", "\n")
