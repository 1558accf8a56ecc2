"""The canopen library's SDO client and NMT on a link that is pumped by its own caller."""

from __future__ import annotations

from collections.abc import Callable

import canopen
from canopen.sdo import SdoClient, SdoCommunicationError
from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen.frame import SDO_ANSWER, SDO_REQUEST, Frame
from drivers.canopen.link import Link

_ABORTED = 0x80

Dispatch = Callable[[Frame], None]


class LinkNetwork(canopen.Network):
    """A network without thread or adapter: frames leave through the link, `pump` brings the answers in."""

    def __init__(self, link: Link, dispatch: Dispatch) -> None:
        super().__init__()
        self._link = link
        self._dispatch = dispatch

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send through the link; remote frames are not used by this project."""
        self._link.send(can_id, bytes(data))

    def now_ns(self) -> int:
        """The link's present time [ns]."""
        return self._link.now_ns()

    def pump(self, deadline_ns: int) -> bool:
        """Receive and dispatch one frame; False when none came before the deadline."""
        frame = self._link.receive(deadline_ns)
        if frame is None:
            return False
        self._dispatch(frame)
        return True


class PumpedSdoClient(SdoClient):
    """The library's SDO client, waiting by pumping the link instead of blocking on another thread.

    Several waits in one thread also make it safe: the library's own client must not be shared by threads.
    """

    MAX_RETRIES = 2  # requests in all; configuration writes are idempotent

    def __init__(self, network: LinkNetwork, node: int, timeout_s: float, idle: Callable[[], None]) -> None:
        super().__init__(SDO_REQUEST + node, SDO_ANSWER + node, canopen.ObjectDictionary())
        self.network = network
        self.network.subscribe(self.tx_cobid, self.on_response)
        self._timeout_ns = round(timeout_s * 1e9)
        self._idle = idle

    def read_response(self) -> bytes:
        """The server's answer, in the library's terms.

        Raises:
            SdoCommunicationError: no answer in time.
            SdoAbortedError: the server refused.
        """
        deadline_ns = self.network.now_ns() + self._timeout_ns
        self._idle()
        while self.responses.empty():
            if not self.network.pump(deadline_ns):
                raise SdoCommunicationError("no answer")
        response: bytes = self.responses.get()
        if response[0] == _ABORTED:
            raise SdoAbortedError(int.from_bytes(response[4:8], "little"))
        return response

    def abort(self, abort_code: int = 0x08000000) -> None:
        """Tell the server that the transfer is over; the caller reports it, not a log."""
        self.send_request(b"\x80\0\0\0" + abort_code.to_bytes(4, "little"))
