"""Two pseudo-terminals joined like the ends of a serial line: Modbus RTU between processes of one machine."""

import os
import select
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Thread

PIECE_BYTES = 4096  # bytes: sixteen of the largest frames


@contextmanager
def pseudo_line() -> Iterator[tuple[str, str]]:
    """Give the paths of a line's two ends for as long as the context lasts.

    What is sent into one end comes out of the other, at once whatever the baud rate. Both ends stay there while the
    processes on them come and go.
    """
    import tty  # Unix alone has it: elsewhere the commands beside this one load all the same

    ends = [os.openpty() for _ in range(2)]
    stop_read, stop_write = os.pipe()
    for controlling, end in ends:
        tty.setraw(end)
        os.set_blocking(controlling, False)  # as on a wire, what nobody takes is lost
    across = {ends[0][0]: ends[1][0], ends[1][0]: ends[0][0]}
    thread = Thread(target=_carry, args=(across, stop_read), daemon=True, name="pseudo line")
    thread.start()
    try:
        yield os.ttyname(ends[0][1]), os.ttyname(ends[1][1])
    finally:
        os.close(stop_write)
        thread.join()
        for fd in (stop_read, *ends[0], *ends[1]):
            os.close(fd)


def _carry(across: dict[int, int], stop: int) -> None:
    while True:
        ready, _, _ = select.select((*across, stop), (), ())
        if stop in ready:
            return
        for end in ready:
            with suppress(BlockingIOError):
                os.write(across[end], os.read(end, PIECE_BYTES))
