"""Precedence for the threads that keep time, where the system grants it."""

from __future__ import annotations

import contextlib
import gc
import os
import sys
from collections.abc import Iterator

_PRIORITY = 20
"""Of SCHED_FIFO (1 to 99): above every ordinary process, below the kernel's own interrupt threads (50)."""

_NICE = -10
"""Where real-time scheduling is refused but this is not."""

_SWITCH_S = 5e-4
"""How long one thread may keep the interpreter from the cycle."""


def precedence() -> str:
    """Take precedence for this thread and those it starts; return what was granted, empty for nothing."""
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
        return f"SCHED_FIFO {_PRIORITY}"
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICE)
        return f"nice {_NICE}"
    return ""


@contextlib.contextmanager
def keeping_time(is_wanted: bool = True) -> Iterator[str]:
    """Run with precedence, quick thread switches and no garbage collection; all is put back at the end."""
    if not is_wanted:
        yield ""
        return
    policy, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    nice, switch_s = os.getpriority(os.PRIO_PROCESS, 0), sys.getswitchinterval()
    was_collecting = gc.isenabled()
    gc.collect()
    gc.disable()  # a collection in the cycle costs milliseconds
    sys.setswitchinterval(_SWITCH_S)
    try:
        yield precedence()
    finally:
        sys.setswitchinterval(switch_s)
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, policy, parameter)
            os.setpriority(os.PRIO_PROCESS, 0, nice)
        if was_collecting:
            gc.enable()
