"""Entry point of `msggen` and of `python -m msggen`: from the first lines here on, Ctrl-C means exit code 130.

There is no trace then. Before them Python itself starts, with `site` and the program that pip installs. Ctrl-C there
can still give a trace of Python, which msggen cannot prevent.
"""

import _signal  # type: ignore[import-not-found]  # `signal` and `enum`, which it imports, take milliseconds
import os
import sys


def _leave(*_: object) -> None:
    os._exit(130)  # INTERRUPTED, whose module is not imported yet


_HANDLES = _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler
"""Whether Ctrl-C is for this process: a shell ignores it for programs in the background."""

if _HANDLES:
    _signal.signal(_signal.SIGINT, _leave)  # before the imports, which take most of a short run

if __name__ == "__main__" and sys.path[:1] == [os.getcwd()] and not getattr(sys.flags, "safe_path", False):
    del sys.path[0]  # `-m` puts the current folder there, and a `signal.py` of it before that of the standard library


def _interrupt(*_: object) -> None:
    """Raise KeyboardInterrupt, so that temporary files are removed. A second Ctrl-C does not wait for that."""
    _signal.signal(_signal.SIGINT, _leave)
    raise KeyboardInterrupt


def _report_ignored(ignored: "sys.UnraisableHookArgs") -> None:
    """Leave if Ctrl-C came where Python ignores exceptions, such as in a destructor."""
    if ignored.exc_type is KeyboardInterrupt:
        _leave()
    sys.__unraisablehook__(ignored)


def main() -> int:
    """Run msggen with the arguments of this process, and return the exit code."""
    from msggen.base.exit_codes import INTERRUPTED
    from msggen.cli import main as run

    if "_ARGCOMPLETE" in os.environ:  # the shell asks for completions
        from msggen.cli.commands.completion import complete

        complete()
    if not _HANDLES:
        return run()
    sys.unraisablehook = _report_ignored
    try:
        _signal.signal(_signal.SIGINT, _interrupt)
        try:
            return run()
        finally:
            _signal.signal(_signal.SIGINT, _signal.SIG_IGN)  # all is done and printed
    except KeyboardInterrupt:
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
