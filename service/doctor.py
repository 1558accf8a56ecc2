"""Is this machine fit to record? Checks of buses, ports, clocks, precedence and disk, each with its fix."""

from __future__ import annotations

import contextlib
import grp
import os
import resource
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from daq.preflight import Check
from daq.realtime import keeping_time
from drivers.force_plate.latency_timer import SYSFS_ROOT, latency_timer
from service.robots import LoadedRobot

_NET = Path("/sys/class/net")
_CAN_TYPE = 280  # ARPHRD_CAN of linux/if_arp.h
_SERIAL = ("ttyUSB*", "ttyACM*")
_LEAST_FREE = 2_000_000_000  # bytes: some hundred runs
_WAKES = 200
_WAKE_S = 2e-3
_LATE_S = 3.3e-3  # half a period at 150 Hz: a later wake-up makes a late SYNC
_RULES = Path("/etc/udev/rules.d/99-residuum.rules")


@dataclass(frozen=True)
class Finding:
    """One check of the doctor.

    Attributes:
        area: ``bus``, ``plate``, ``clock``, ``precedence`` or ``disk``.
        level: ``ok``, ``warning`` (recording works, less well) or ``error`` (it does not).
        sentence: what was found.
        fix: what to do about it.
    """

    area: str
    level: str
    sentence: str
    fix: str = ""


def examine(loaded: LoadedRobot | None = None, folder: Path = Path(".")) -> tuple[Finding, ...]:
    """Look at everything that recording needs.

    Args:
        loaded: a robot whose own bus and plate are looked at; whatever is there, where not given.
        folder: where logs go.
    """
    return (
        *_buses(loaded), *_plates(loaded), *_clocks(), *_precedence(), *_disk(folder),
    )


def _buses(loaded: LoadedRobot | None) -> Iterator[Finding]:
    section = loaded.file.bus if loaded is not None else None
    if loaded is not None and section is None:
        yield Finding("bus", "error", f"Robot {loaded.where} has no [bus] section.",
                      "Describe the bus and give every joint its node (see docs/recording.md).")
        return
    if section is not None and section.interface != "socketcan":
        yield _other_adapter(section.interface)
        return
    names = [section.channel] if section is not None else _can_interfaces()
    if not names:
        yield Finding("bus", "warning", "This machine has no CAN interface.",
                      "Plug the adapter in; a serial one needs: sudo slcand -o -s8 /dev/ttyACM0 can0.")
    for name in names:
        yield from _interface(name)


def _other_adapter(interface: str) -> Finding:
    import can

    if interface in can.VALID_INTERFACES:
        return Finding("bus", "ok", f"The CAN adapter is driven by python-can's '{interface}'.")
    return Finding("bus", "error", f"python-can has no interface '{interface}'.",
                   f"Choose one of {', '.join(sorted(can.VALID_INTERFACES))}.")


def _can_interfaces() -> list[str]:
    found = []
    for entry in sorted(_NET.glob("*")):
        with contextlib.suppress(OSError, ValueError):
            if int((entry / "type").read_text()) == _CAN_TYPE:
                found.append(entry.name)
    return found


def _interface(name: str) -> Iterator[Finding]:
    place = _NET / name
    if not place.exists():
        yield Finding("bus", "error", f"There is no CAN interface {name}.",
                      "Check the adapter's cable and driver (dmesg), or the channel in the robot file.")
        return
    if _read(place / "operstate") not in ("up", "unknown"):
        yield Finding("bus", "error", f"The CAN interface {name} is down.",
                      f"sudo ip link set {name} up type can bitrate 1000000 restart-ms 0; for good install "
                      "deploy/systemd/80-can.network.")
        return
    queue = int(_read(place / "tx_queue_len") or 0)
    if queue < 64:  # 32 axes and their SDO answers within one cycle
        yield Finding("bus", "warning", f"{name} queues {queue} frames only, less than a cycle may send.",
                      f"sudo ip link set {name} txqueuelen 128.")
    errors = int(_read(place / "statistics" / "tx_errors") or 0)
    if errors:
        yield Finding("bus", "warning", f"{name} has counted {errors} transmit errors since it came up.",
                      "Check termination (60 ohm between the wires), bit rate and cable.")
    yield Finding("bus", "ok", f"The CAN interface {name} is up.")


def _read(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def _plates(loaded: LoadedRobot | None) -> Iterator[Finding]:
    plate = loaded.file.force_plate if loaded is not None else None
    if loaded is not None and (plate is None or plate.connection is None):
        yield Finding("plate", "ok", "The robot file connects no force plate.")
        return
    if plate is not None and plate.connection is not None:
        ports = [Path(plate.connection.port)]
    else:
        ports = sorted(port for pattern in _SERIAL for port in Path("/dev").glob(pattern))
    if not ports:
        yield Finding("plate", "warning", "This machine has no USB serial port.", "Plug the force plate in.")
    for port in ports:
        yield from _port(port)


def _port(port: Path) -> Iterator[Finding]:
    if not port.exists():
        yield Finding("plate", "error", f"The force plate's port {port} does not exist.",
                      "Check the cable, and the name with: ls /dev/serial/by-id.")
        return
    if not os.access(port, os.R_OK | os.W_OK):
        group = grp.getgrgid(port.stat().st_gid).gr_name
        yield Finding("plate", "error", f"You may not open {port}.",
                      f"sudo usermod -aG {group} $USER, then log out and in.")
    timer = latency_timer(str(port), SYSFS_ROOT)
    if timer is not None and not timer.is_good:
        yield Finding("plate", "warning", f"{port} holds bytes back for up to {timer.value_ms} ms.",
                      f"echo 1 | sudo tee {timer.path}; for good: "
                      f"sudo cp deploy/udev/{_RULES.name} {_RULES}.")
        return
    yield Finding("plate", "ok", f"The serial port {port} is there.")


def _clocks() -> Iterator[Finding]:
    source = _read(Path("/sys/devices/system/clocksource/clocksource0/current_clocksource"))
    if source and source not in ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page"):
        yield Finding("clock", "warning", f"The kernel's clock source is {source}, slow to read.",
                      "Boot with clocksource=tsc where the processor's counter is constant.")
    worst_s = worst_wake_s()
    if worst_s > _LATE_S:
        yield Finding("clock", "warning",
                      f"A timer woke this process up to {worst_s * 1e3:.1f} ms late: SYNCs will leave late.",
                      "Stop other load, set the performance governor, allow real-time precedence (below).")
    else:
        yield Finding("clock", "ok", f"Timers wake this process at most {worst_s * 1e3:.2f} ms late.")
    if time.get_clock_info("monotonic").resolution > 1e-6:
        yield Finding("clock", "error", "The monotonic clock is coarser than a microsecond.",
                      "Record on another machine.")


def worst_wake_s() -> float:
    """The latest of some hundred timed wake-ups [s]."""
    worst = 0.0
    with keeping_time():
        for _ in range(_WAKES):
            due = time.monotonic() + _WAKE_S
            time.sleep(_WAKE_S)
            worst = max(worst, time.monotonic() - due)
    return worst


def _precedence() -> Iterator[Finding]:
    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO) if hasattr(resource, "RLIMIT_RTPRIO") else (0, 0)
    if os.geteuid() == 0 or soft > 0 or soft == resource.RLIM_INFINITY:
        yield Finding("precedence", "ok", "Real-time precedence is allowed.")
    else:
        yield Finding("precedence", "warning", "Real-time precedence is refused: other load delays SYNCs.",
                      "sudo cp deploy/limits/99-residuum.conf /etc/security/limits.d/, then log out and in.")
    cores = os.cpu_count() or 1
    if cores < 2:
        yield Finding("precedence", "warning", "This machine has a single core.", "Use one with two or more.")


def _disk(folder: Path) -> Iterator[Finding]:
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        yield Finding("disk", "error", f"Logs cannot be written to {folder}.",
                      "Choose a folder that exists and that you may write to.")
        return
    free = shutil.disk_usage(folder).free
    if free < _LEAST_FREE:
        yield Finding("disk", "warning", f"{folder.resolve()} has {free / 1e9:.2f} GB free.",
                      "Free some space: a run of three axes and a plate takes 12 MB.")
    else:
        yield Finding("disk", "ok", f"{folder.resolve()} has {free / 1e9:.1f} GB free.")


def realtime_checks() -> tuple[Check, ...]:
    """What a run on real hardware demands of the machine beforehand; only what makes it hopeless refuses."""
    resolution_s = time.get_clock_info("monotonic").resolution
    return (
        Check("clock", resolution_s <= 1e-6, "The monotonic clock is coarser than a microsecond",
              "record on another machine", "hardware"),
    )
