"""The loopback CAN bus: several ends and processes, nothing lost, garbage dropped, dead and deaf ends survived."""

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from threading import Event, Thread, current_thread
from typing import Any

import can
import pytest

from fieldbus.canopen import loopback as can_bus
from fieldbus.canopen.loopback import CHANNEL_ENDS, HOST, MAGIC, WINDOW, LoopbackBus, free_channel

pytestmark = pytest.mark.real_time

BURST = 3000

Join = Callable[..., LoopbackBus]


@pytest.fixture
def join() -> Iterator[Join]:
    """Give ends of one bus."""
    channel = free_channel()
    ends: list[LoopbackBus] = []

    def join(**more: object) -> LoopbackBus:
        end = can.Bus(interface="loopback", channel=channel, ignore_config=True, **more)  # type: ignore[arg-type]
        assert isinstance(end, LoopbackBus)
        ends.append(end)
        return end

    yield join
    for end in ends:
        end.shutdown()


def frame(identity: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=identity, data=data, is_extended_id=False)


def burst(bus: can.BusABC, count: int) -> None:
    for n in range(count):
        bus.send(frame(n % 2000))


def received(bus: can.BusABC, count: int) -> list[int]:
    """Return the ids of so many frames, or of as many as come."""
    found: list[int] = []
    while len(found) < count and (message := bus.recv(5.0)) is not None:
        found.append(message.arbitration_id)
    return found


def test_every_end_but_the_sender_gets_every_frame_as_it_was(join: Join) -> None:
    first, second, third = join(), join(), join()
    sent = [
        frame(0x185, b"\x01\x02"),
        frame(0x7FF, bytes(8)),
        can.Message(arbitration_id=0x1ABCDEF0, is_extended_id=True, data=b"x"),
        can.Message(arbitration_id=5, is_remote_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x40, is_error_frame=True, is_extended_id=False, data=bytes(8)),
    ]
    for message in sent:
        second.send(message)
    for end in (first, third):
        for message in sent:
            came = end.recv(1.0)
            assert came is not None
            assert came.equals(message, timestamp_delta=None, check_channel=False, check_direction=False)
    assert second.recv(0.0) is None


def test_a_newcomer_is_heard_at_once_and_one_who_left_is_forgotten(join: Join) -> None:
    first = join()
    first.send(frame(1))
    second = join()
    second.send(frame(2))
    assert received(first, 1) == [2]
    first.send(frame(3))
    assert received(second, 1) == [3]
    second.shutdown()
    first.send(frame(4))
    again = join()
    assert again.port == second.port
    again.send(frame(5))
    assert received(first, 1) == [5]
    first.send(frame(6))
    assert received(again, 1) == [6], "and nothing from before it came"


def test_a_frame_sent_while_a_reader_has_a_hello_in_hand_goes_to_the_newcomer(
    join: Join, monkeypatch: pytest.MonkeyPatch
) -> None:
    end = join()
    in_hand, go_on, peer_at = Event(), Event(), can_bus.Peer

    def slowly(port: int) -> Any:
        if current_thread() is reader:
            in_hand.set()
            assert go_on.wait(10)
        return peer_at(port)

    monkeypatch.setattr(can_bus, "Peer", slowly)
    monkeypatch.setattr(can_bus, "BUS_LOOK_S", 0.0)
    reader = Thread(target=end.recv, args=(0.5,))
    reader.start()
    newcomer = join()
    assert in_hand.wait(10)
    sender = Thread(target=end.send, args=(frame(1),))
    sender.start()
    sender.join(0.05)  # it must wait; long enough for one that does not
    go_on.set()
    for each in (sender, reader):
        each.join()
    assert received(newcomer, 1) == [1]


def test_nothing_is_lost_in_a_burst_of_all_to_all(join: Join, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_bus, "DEAF_S", 5.0)  # six threads of one interpreter may keep a reader waiting
    ends = [join() for _ in range(3)]
    assert [end.recv(0.0) for end in ends] == [None] * 3, "each has taken the others' hellos, and knows them"
    seen: dict[int, list[int]] = {}
    readers = [Thread(target=lambda e=end: seen.update({e.port: received(e, 2 * BURST)})) for end in ends]
    senders = [Thread(target=burst, args=(end, BURST)) for end in ends]
    for thread in (*readers, *senders):
        thread.start()
    for thread in (*senders, *readers):
        thread.join()
    assert all(sorted(ids) == sorted([n % 2000 for n in range(BURST)] * 2) for ids in seen.values())
    assert [end.lost_frames for end in ends] == [0, 0, 0]


def test_as_many_frames_as_all_others_may_send_unread_fit_into_the_receive_buffer(join: Join) -> None:
    reader, senders = join(), [join() for _ in range(CHANNEL_ENDS - 1)]
    for end in senders:
        for n in range(WINDOW):
            end.send(frame(n, bytes(8)))
    assert len(received_now(reader)) == WINDOW * len(senders)
    assert reader.lost_frames == 0


def received_now(bus: can.BusABC) -> list[can.Message]:
    found = []
    while (message := bus.recv(0.0)) is not None:
        found.append(message)
    return found


def test_processes_share_a_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    channel = free_channel()
    code = (
        "import fieldbus.canopen.loopback\n"
        "import can\nfieldbus.canopen.loopback.DEAF_S = 5.0\n"
        f"bus = can.Bus(interface='loopback', channel='{channel}', ignore_config=True)\n"
        "print('there', flush=True)\n"
        f"for _ in range({BURST}):\n"
        "    message = bus.recv(10)\n"
        "    bus.send(can.Message(arbitration_id=message.arbitration_id + 1, is_extended_id=False))\n"
        "bus.shutdown()\n"
    )
    monkeypatch.setattr(can_bus, "DEAF_S", 5.0)
    with LoopbackBus(channel) as bus, subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"there\n"
        thread = Thread(target=burst, args=(bus, BURST))
        thread.start()
        assert received(bus, BURST) == [n % 2000 + 1 for n in range(BURST)]
        thread.join()
        assert other.wait(10) == 0


def test_what_reads_log_files_is_not_loaded_with_it_and_there_for_others() -> None:
    code = (
        "import sys\nimport fieldbus.canopen.loopback\n"
        "from importlib.util import find_spec\nprint('asammdf' in sys.modules, find_spec('asammdf') is not None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_garbage_strangers_and_torn_datagrams_are_dropped(join: Join) -> None:
    first, second = join(), join()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for junk in (b"", b"\0" * 18, b"pCAN", b"pCAN" + bytes(60), bytes(range(200)), b"pCAN\x01\x63" + bytes(16)):
            stranger.sendto(junk, (HOST, first.port))
    for torn in (
        b"pCAN\x01\0\0",
        b"pCAN\x63\x01" + bytes(8),
        b"pCAN\x01\x01" + bytes(40),
        b"pCAN\x00\x01" + bytes(8) + b"abc",
    ):
        second.socket.sendto(torn, (HOST, first.port))
    second.send(frame(7))
    assert received(first, 1) == [7]
    assert received_now(first) == []


def test_who_is_not_an_end_can_say_nothing_for_one(join: Join) -> None:
    """Datagrams right to the last byte, but sent from elsewhere: frames, a hello, an acknowledgement, a farewell."""
    first, second = join(), join()
    second.send(frame(1))
    assert received(first, 1) == [1]
    before = dict(first.peers)
    peer = before[second.port]
    state = (peer.sent, peer.acked, peer.received, peer.filters)
    forged = [can_bus.FRAME.pack(MAGIC, can_bus.DATA, end, 2, 0, 0x205) + bytes(8) for end in (second.end, 5)]
    forged += [can_bus.HEAD.pack(MAGIC, kind, second.end, 9, 0) for kind in (can_bus.HELLO, can_bus.ACK, can_bus.BYE)]
    for host, port in ((HOST, 0), ("127.0.0.2", second.port)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind((host, port))
            for datagram in forged:
                stranger.sendto(datagram, (HOST, first.port))
    assert received_now(first) == []
    assert first.peers == before
    assert (peer.sent, peer.acked, peer.received, peer.filters) == state
    second.send(frame(7))
    assert received(first, 1) == [7]
    assert first.lost_frames == 0


def test_it_is_on_the_loopback_only(join: Join) -> None:
    assert join().socket.getsockname()[0] == "127.0.0.1"


def test_one_that_does_not_read_holds_up_nobody_and_knows_what_it_missed(join: Join) -> None:
    sender, deaf, reader = join(), join(), join()
    start_s = time.monotonic()
    seen: list[int] = []
    thread = Thread(target=lambda: seen.extend(received(reader, 500)))
    thread.start()
    for n in range(500):
        sender.send(frame(n))
    thread.join()
    assert seen == list(range(500)), "the others lose nothing"
    assert time.monotonic() - start_s < 5.0
    assert [each.arbitration_id for each in received_now(deaf)] == list(range(WINDOW))
    deaf.send(frame(1))
    assert received(sender, 1) == [1]
    sender.send(frame(9))
    assert received(deaf, 1) == [9], "it is heard again"


def test_one_killed_without_goodbye_is_forgotten(join: Join) -> None:
    sender, killed = join(), join()
    assert killed.peers  # the system closes the socket of a killed process
    killed.socket.close()
    start_s = time.monotonic()
    for n in range(4 * WINDOW):
        sender.send(frame(n))
    assert killed.port not in sender.peers
    assert time.monotonic() - start_s < 1.0


def test_one_killed_and_back_before_anybody_noticed_begins_anew(join: Join) -> None:
    sender, killed = join(), join()
    for n in range(20):
        sender.send(frame(n))
    killed.socket.close()
    again = join()
    assert again.port == killed.port
    again.send(frame(1))
    assert received(sender, 1) == [1]
    sender.send(frame(2))
    sender.send(frame(3))
    assert received(again, 2) == [2, 3]
    assert again.lost_frames == 0


def test_what_an_end_does_not_want_is_not_even_sent(join: Join) -> None:
    sender = join()
    picky = join(can_filters=[{"can_id": 0x180, "can_mask": 0x780, "extended": False}])
    for identity in (0x80, 0x185, 0x200, 0x186):
        sender.send(frame(identity))
    assert received(picky, 2) == [0x185, 0x186]
    assert sender.peers[picky.port].sent == 2
    picky.set_filters(None)
    sender.recv(0.0)  # it looks at least once a millisecond
    sender.send(frame(0x80))
    assert received(picky, 1) == [0x80]


def test_a_change_of_filters_loses_nothing_and_holds_up_nobody(join: Join, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_bus, "DEAF_S", 5.0)
    sender, reader = join(), join()
    seen: list[int] = []
    thread = Thread(target=lambda: seen.extend(received(reader, 40 + 3 * WINDOW)))
    thread.start()
    burst(sender, 40)
    reader.set_filters([{"can_id": 0, "can_mask": 0, "extended": False}])
    start_s = time.monotonic()
    burst(sender, 3 * WINDOW)
    thread.join()
    assert seen == [*range(40), *range(3 * WINDOW)]
    assert time.monotonic() - start_s < 4.0
    assert reader.lost_frames == 0


def test_a_full_bus_and_a_bad_channel_are_refused(join: Join) -> None:
    for _ in range(CHANNEL_ENDS):
        join()
    with pytest.raises(can.CanInitializationError, match="all of its 16 ends are taken"):
        join()
    for channel in ("can0", "80", "65530"):
        with pytest.raises(can.CanInitializationError, match="is not a port"):
            LoopbackBus(channel)


def test_frames_of_can_fd_and_a_closed_end_are_refused(join: Join) -> None:
    end, _ = join(), join()
    with pytest.raises(can.CanOperationError, match="classical CAN only"):
        end.send(can.Message(arbitration_id=1, data=bytes(12), is_fd=True))
    end.shutdown()
    with pytest.raises(can.CanOperationError):
        end.send(frame(1))
    with pytest.raises(can.CanOperationError):
        end.recv(0.01)


def test_a_reader_is_not_left_waiting_for_what_a_sender_took(join: Join, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread that waits to send takes what comes; the thread that reads must still get it."""
    monkeypatch.setattr(can_bus, "DEAF_S", 0.2)
    end, full, chatty = join(), join(), join()
    seen: list[int] = []
    thread = Thread(target=lambda: seen.extend(received(end, 3 * WINDOW)))
    thread.start()
    talk = Thread(target=burst, args=(chatty, 3 * WINDOW))
    listen = Thread(target=lambda: received(chatty, 2 * WINDOW))
    talk.start()
    listen.start()
    for n in range(2 * WINDOW):
        end.send(frame(n))
    for each in (talk, thread, listen):
        each.join()
    assert seen == list(range(3 * WINDOW))
    assert full.port
