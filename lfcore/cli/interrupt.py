"""Ctrl-C and the signals that end a process work within seconds, also while a kernel runs.

Python runs a signal's handler in the main thread, between two instructions.  While this thread
waits for an OpenCL kernel, which can take minutes, no handler runs.  A second thread therefore
watches for signals.  If the command does not end soon after one, it removes half-written files and
ends the process.
"""

import os
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from lfcore.files import abandon_drafts

GRACE_S = 1.0
"""The time in which a command should end by itself."""
WORDS = {signal.SIGINT: "Interrupted.", signal.SIGTERM: "Terminated."}
if hasattr(signal, "SIGHUP"):
    WORDS[signal.SIGHUP] = "The terminal has gone."


class Terminated(KeyboardInterrupt):
    """A signal other than Ctrl-C, whose number is the argument, ends this process."""


def ending(interrupt: KeyboardInterrupt) -> tuple[str, int]:
    """The message for the user and the exit status: 128 plus the signal's number, as in shells."""
    number = interrupt.args[0] if isinstance(interrupt, Terminated) else signal.SIGINT
    return WORDS[signal.Signals(number)], 128 + number


@contextmanager
def interruptible() -> Iterator[None]:
    """While the block runs in the main thread, a signal ends the process within seconds.

    First it raises :class:`KeyboardInterrupt` or :class:`Terminated` in the block.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    watched, written = socket.socketpair()
    written.setblocking(False)
    ended = threading.Event()
    watcher = threading.Thread(target=_watch, args=(watched, ended), daemon=True)
    before = signal.set_wakeup_fd(written.fileno(), warn_on_full_buffer=False)
    # Not if another handler is set: `nohup` ignores SIGHUP, for example.
    ours = [n for n in WORDS if n != signal.SIGINT and signal.getsignal(n) == signal.SIG_DFL]
    for number in ours:
        signal.signal(number, _raise)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        for number in ours:
            signal.signal(number, signal.SIG_DFL)
        signal.set_wakeup_fd(before)
        with suppress(OSError):
            watched.shutdown(socket.SHUT_RDWR)
        watcher.join()
        watched.close()
        written.close()


def leave_at_once(status: int) -> None:
    """End the process without waiting for threads; no half-written file is left."""
    abandon_drafts()
    os._exit(status)


def _raise(number: int, _: FrameType | None) -> None:
    raise Terminated(number)


def _watch(watched: socket.socket, ended: threading.Event) -> None:
    while data := watched.recv(1):
        if data[0] in WORDS and not ended.wait(GRACE_S):
            with suppress(OSError):
                # Below the bar of progress, with the cursor that it has hidden.
                start = "\x1b[?25h\n" if os.isatty(2) else ""
                os.write(2, f"{start}{WORDS[signal.Signals(data[0])]}\n".encode())
            leave_at_once(128 + data[0])
