"""Confirmed access to one drive: read, write with read-back, and put back what was changed."""

from __future__ import annotations

from canopen.sdo.exceptions import SdoAbortedError, SdoError

from drivers.canopen.config import AxisConfig
from drivers.canopen.network import PumpedSdoClient
from drivers.canopen.objects import DEVICE_TYPE, Entry
from drivers.errors import LinkError, ReadBackError, SdoFailedError


class DriveNode:
    """One drive behind its SDO server; remembers the first value of everything it changes."""

    def __init__(self, axis: AxisConfig, client: PumpedSdoClient) -> None:
        self.axis = axis
        self._client = client
        self._before: dict[Entry, int] = {}

    @property
    def where(self) -> str:
        """The drive in words."""
        return f"drive of {self.axis.name} (node {self.axis.node})"

    def now_ns(self) -> int:
        """Present time of the link [ns]."""
        return self._client.network.now_ns()

    def read(self, entry: Entry) -> int:
        """The number in one entry.

        Raises:
            SdoFailedError: refused, or no answer in time.
        """
        try:
            return entry.unpack(self._client.upload(entry.index, entry.sub))
        except SdoError as error:
            raise SdoFailedError(self._sentence("read", entry, error)) from None

    def read_or(self, entry: Entry, default: int | None) -> int | None:
        """The number in an entry that a drive may lack; `default` when it refuses."""
        try:
            return entry.unpack(self._client.upload(entry.index, entry.sub))
        except SdoAbortedError:
            return default
        except SdoError as error:
            raise SdoFailedError(self._sentence("read", entry, error)) from None

    def read_text(self, index: int, sub: int = 0) -> str:
        """A string (segmented transfer), empty where the drive has none."""
        try:
            return self._client.upload(index, sub).decode("latin-1").rstrip("\0 ")
        except SdoAbortedError:
            return ""
        except SdoError as error:
            raise SdoFailedError(self._sentence("read", Entry(index, sub, "B", "text"), error)) from None

    def put(self, entry: Entry, value: int) -> None:
        """Write without reading back (commands and PDO switches that read differently)."""
        try:
            self._client.download(entry.index, entry.sub, entry.pack(value))
        except SdoError as error:
            raise SdoFailedError(self._sentence(f"take {value} in", entry, error)) from None

    def write(self, entry: Entry, value: int) -> None:
        """Write and read back.

        Raises:
            SdoFailedError: refused, or no answer in time.
            ReadBackError: another value reads back.
        """
        self.put(entry, value)
        got = self.read(entry)
        if got != value:
            raise ReadBackError(
                f"The {self.where} was given {value} for {entry.address} ({entry.name}) but reads back {got}"
                "; the value is outside what it takes, or another master writes too."
            )

    def change(self, entry: Entry, value: int) -> None:
        """Write and read back, remembering the value found before so that `restore` can put it back."""
        before = self.read(entry)
        self._before.setdefault(entry, before)
        if before != value:
            self.write(entry, value)

    def restore(self) -> list[str]:
        """Put back every changed value, last change first.

        Returns:
            One sentence for each value that could not be put back.
        """
        failures: list[str] = []
        while self._before:
            entry, value = self._before.popitem()
            try:
                self.put(entry, value)
            except (SdoFailedError, LinkError) as error:
                failures.append(str(error))
                if not self._answers():
                    self._before.clear()  # a silent drive would cost a timeout for each value
        return failures

    def _answers(self) -> bool:
        try:
            self.read(DEVICE_TYPE)
        except (SdoFailedError, LinkError):
            return False
        return True

    def _sentence(self, verb: str, entry: Entry, error: SdoError) -> str:
        reason = str(error) if isinstance(error, SdoAbortedError) else "no answer in time"
        return (
            f"The {self.where} did not {verb} {entry.address} ({entry.name}): {reason}; "
            "check its manual for the object, and the wiring if nothing answers."
        )
