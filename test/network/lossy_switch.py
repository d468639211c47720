"""An Ethernet switch in user space between TAP interfaces, with cuts, loss and delay: netem where there is none."""

from __future__ import annotations

import fcntl
import heapq
import os
import random
import select
import struct
import threading
import time

_TUNSETIFF, _IFF_TAP, _IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
_LONGEST_FRAME = 65536


class LossySwitch:
    """Forward every frame to all other ports.

    Args:
        names: names of the TAP interfaces to make; move them into namespaces afterwards.
    """

    def __init__(self, names: list[str]) -> None:
        self.loss, self.delay_s = 0.0, 0.0
        self.cut: set[str] = set()
        self.n_frames = self.n_lost = 0
        self._ports: dict[int, str] = {}
        for name in names:
            descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
            fcntl.ioctl(descriptor, _TUNSETIFF, struct.pack("16sH", name.encode(), _IFF_TAP | _IFF_NO_PI))
            self._ports[descriptor] = name
        self._is_running = True
        self._thread = threading.Thread(target=self._forward)
        self._thread.start()

    def close(self) -> None:
        """Stop forwarding; the interfaces vanish."""
        self._is_running = False
        self._thread.join()
        for descriptor in self._ports:
            os.close(descriptor)

    def _forward(self) -> None:
        generator = random.Random(5)
        waiting: list[tuple[float, int, int, bytes]] = []
        while self._is_running:
            timeout = min(max(waiting[0][0] - time.monotonic(), 0.0), 0.05) if waiting else 0.05
            readable, _, _ = select.select(list(self._ports), [], [], timeout)
            now = time.monotonic()
            for source in readable:
                try:
                    frame = os.read(source, _LONGEST_FRAME)
                except OSError:
                    continue  # not up yet
                if self._ports[source] in self.cut:
                    continue
                for port, name in self._ports.items():
                    if port == source or name in self.cut:
                        continue
                    self.n_frames += 1
                    if generator.random() < self.loss:
                        self.n_lost += 1
                        continue
                    heapq.heappush(waiting, (now + self.delay_s, self.n_frames, port, frame))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, port, frame = heapq.heappop(waiting)
                try:
                    os.write(port, frame)
                except OSError:
                    continue
