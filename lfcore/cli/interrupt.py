"""Ctrl-C and the signals that end a process, obeyed within seconds whatever is being computed.

Python runs a signal's handler between two of its own instructions, in the main thread.  A kernel
of OpenCL can run for minutes, cannot be stopped, and the main thread, or one that it waits for,
waits for it.  So another thread is told of the signal, too; when the command has not ended by
itself soon, that thread removes what is half written and ends the process.
"""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from lfcore.files import abandon_drafts

GRACE_S = 1.0
"""For the command to end by itself: longer is felt at the keyboard."""
WORDS = {signal.SIGINT: "Interrupted.", signal.SIGTERM: "Terminated."}
if hasattr(signal, "SIGHUP"):
    WORDS[signal.SIGHUP] = "The terminal has gone."


class Terminated(KeyboardInterrupt):
    """A signal other than Ctrl-C, whose number is the argument, asked this process to end."""


def ending(interrupt: KeyboardInterrupt) -> tuple[str, int]:
    """What to tell the user, and the exit status: 128 and the signal's number, as shells say."""
    number = interrupt.args[0] if isinstance(interrupt, Terminated) else signal.SIGINT
    return WORDS[signal.Signals(number)], 128 + number


@contextmanager
def interruptible() -> Iterator[None]:
    """While the block runs, a signal ends the process within seconds.

    At first it is an exception in the block, :class:`KeyboardInterrupt` or :class:`Terminated`.
    Does nothing outside the main thread, which alone may handle signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    told, teller = socket.socketpair()
    teller.setblocking(False)
    ended = threading.Event()
    watcher = threading.Thread(target=_watch, args=(told, ended), daemon=True)
    before = signal.set_wakeup_fd(teller.fileno(), warn_on_full_buffer=False)
    # Only where nobody else has decided: `nohup` ignores SIGHUP, for one.
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
            told.shutdown(socket.SHUT_RDWR)
        watcher.join()
        told.close()
        teller.close()


def leave_at_once(status: int) -> None:
    """End the process without waiting for threads; nothing half written is left."""
    abandon_drafts()
    os._exit(status)


def _raise(number: int, _: FrameType | None) -> None:
    raise Terminated(number)


def _watch(told: socket.socket, ended: threading.Event) -> None:
    while data := told.recv(1):
        if data[0] in WORDS and not ended.wait(GRACE_S):
            with suppress(OSError):
                start = "\n" if os.isatty(2) else ""  # below a line of progress
                os.write(2, f"{start}{WORDS[signal.Signals(data[0])]}\n".encode())
            leave_at_once(128 + data[0])
